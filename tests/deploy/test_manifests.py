"""deploy/: the image, compose and Kubernetes, against their schemas and against what deploy/ promises of them."""

from __future__ import annotations

import re
import shlex
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from deploy.certificates import settings
from facade_core.export.models.page_packing import MAX_PAGE_TEXELS
from tasks.engine.compute.cluster import UNITS_SHARE
from tasks.engine.stage_code import VERSION
from tasks.stages.pages.stage import page_memory
from tasks.stages.shared import memory
from tasks.stages.shared.images import MAX_EXEMPLAR_SIDE, MAX_PIXELS
from tasks.stages.streets.stage import street_memory
from tests.pipeline.runs import ROOT

DEPLOY = ROOT / "deploy"
COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
KUBERNETES = sorted((DEPLOY / "kubernetes").glob("*.yaml"))
IMAGE = f"streetloom:{VERSION}"


def instructions() -> list[tuple[str, str]]:
    """The Dockerfile's, continued lines joined, without comments."""
    text = "\n".join(line for line in (DEPLOY / "Dockerfile").read_text().splitlines() if not line.startswith("#"))
    lines = [line for line in re.sub(r"\\\n\s*", " ", text).splitlines() if line.strip()]
    return [(line.split(maxsplit=1)[0], line.split(maxsplit=1)[1]) for line in lines]


def copied() -> list[str]:
    """What the Dockerfile copies out of the project."""
    words = [shlex.split(rest) for name, rest in instructions() if name == "COPY"]
    return [path for line in words if not line[0].startswith("--from") for path in line[:-1]]


def test_what_the_image_copies_is_there_and_not_ignored() -> None:
    ignored = (DEPLOY / "Dockerfile.dockerignore").read_text().splitlines()
    assert ignored[0] == "*"
    let = [line.removeprefix("!") for line in ignored if line.startswith("!")]
    for path in copied():
        assert (ROOT / path).exists(), path
        assert any(Path(path).match(one) or path.startswith(f"{one}/") for one in let), path
    packages = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"][
        "packages"
    ]
    assert set(packages) <= set(copied())


def test_the_image_installs_by_hash_and_runs_as_somebody_without_rights() -> None:
    steps = instructions()
    installs = [part for name, rest in steps if name == "RUN" for part in rest.split("&&") if " install " in part]
    for step in installs:
        if "apt-get" in step or "install --directory" in step:
            continue
        of_wheel = "--no-deps" in step and step.split()[-1].endswith("*.whl")
        assert "--require-hashes" in step or of_wheel, step
    for name in re.findall(r"-(?:r|-build-constraints) (\S+)", " ".join(rest for _, rest in steps)):
        pinned = (ROOT / name).read_text()
        assert (
            len(re.findall(r"^\S+==", pinned, re.M))
            == len(re.findall(r"^\S+==.*\\\n +--hash=sha256:", pinned, re.M))
            > 0
        )
    final = [name for name, _ in steps].index("FROM", 2)
    users = [rest for name, rest in steps[final:] if name == "USER"]
    assert users == ["10001:10001"]
    assert [name for name, _ in steps[-3:]] == ["USER", "HEALTHCHECK", "CMD"]
    assert not any(re.search(r"(PASSWORD|SECRET|KEY|TOKEN)=", rest) for _, rest in steps)


def test_the_image_has_what_a_run_needs_at_the_versions_that_are_tested() -> None:
    def pins(name: str) -> set[str]:
        return set(re.findall(r"^\S+==\S+", (DEPLOY / "constraints" / name).read_text(), re.M))

    runtime = pins("runtime.txt")
    assert runtime < pins("constraints.txt")
    names = {pin.partition("==")[0].lower() for pin in runtime}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = project["dependencies"] + project["optional-dependencies"]["viewer"]
    assert {re.split(r"[<>=\[]", one)[0].lower().replace(".", "-") for one in wanted} <= names
    assert not {"pytest", "moto", "torch"} & names


def test_compose_is_as_its_specification_has_it() -> None:
    from compose_spec import PyCompose

    PyCompose.from_yaml(yaml.safe_dump(COMPOSE)).validate()  # YAML's own merges are no part of the specification
    wrong = {"services": {"a": {"image": "a", "healthcheck": {"test": ["CMD", "a"], "intervall": "1s"}}}}
    with pytest.raises(ValueError, match="intervall"):
        PyCompose.from_yaml(yaml.safe_dump(wrong))


@pytest.mark.parametrize("name", COMPOSE["services"])
def test_a_service_has_no_more_rights_than_it_needs(name: str) -> None:
    service = COMPOSE["services"][name]
    assert service["read_only"]
    assert service["user"].split(":")[0] not in ("0", "root")
    assert service["cap_drop"] == ["ALL"]
    assert "no-new-privileges:true" in service["security_opt"]
    assert "memory" in service["deploy"]["resources"]["limits"]
    assert ":" in service["image"]
    assert "latest" not in service["image"]
    for port in service.get("ports", ()):
        assert port.startswith("127.0.0.1:")
    told = [f"{key}={value}" for key, value in service.get("environment", {}).items()]
    for line in told:  # a password is named by the file that holds it
        if re.match(r"\w*(PASSWORD|SECRET|AUTH_STRING|ACCESS_KEY)\w*=", line):
            assert re.match(r"\w+_FILE=", line), line
    assert {one for one in service.get("secrets", ())} <= COMPOSE["secrets"].keys()


def test_secrets_of_compose_are_files_that_git_ignores() -> None:
    assert "*" in (DEPLOY / "secrets" / ".gitignore").read_text().splitlines()
    for secret in COMPOSE["secrets"].values():
        assert secret["file"].startswith("./secrets/")


def objects(file: Path) -> list[dict[str, Any]]:
    return list(yaml.safe_load_all(file.read_text()))


@pytest.mark.parametrize("file", KUBERNETES, ids=lambda file: file.name)
def test_kubernetes_takes_the_manifests(file: Path) -> None:
    import kubernetes_validate

    for one in objects(file):
        kubernetes_validate.validate(one, "1.31", strict=True)
        assert one["kind"] == "Namespace" or one["metadata"]["namespace"] == "streetloom"
    wrong = objects(file)[0] | {"speck": {}}
    with pytest.raises(kubernetes_validate.ValidationError):
        kubernetes_validate.validate(wrong, "1.31", strict=True)


def pods() -> Iterator[tuple[str, dict[str, Any]]]:
    for one in (one for file in KUBERNETES for one in objects(file)):
        if one["kind"] in ("Deployment", "StatefulSet"):
            yield one["metadata"]["name"], one


def test_pods_have_no_more_rights_than_they_need() -> None:
    found = dict(pods())
    assert set(found) == {"scheduler", "worker", "prefect", "postgres", "runs"}
    claims = {one["metadata"]["name"] for file in KUBERNETES for one in objects(file) if "Claim" in one["kind"]}
    for name, one in found.items():
        assert one["spec"]["selector"]["matchLabels"] == one["spec"]["template"]["metadata"]["labels"] == {"part": name}
        spec = one["spec"]["template"]["spec"]
        assert spec["automountServiceAccountToken"] is False
        assert spec["securityContext"]["runAsNonRoot"] is True
        assert spec["securityContext"]["runAsUser"] > 0
        assert spec["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
        volumes = {volume["name"] for volume in spec["volumes"]}
        volumes |= {claim["metadata"]["name"] for claim in one["spec"].get("volumeClaimTemplates", ())}
        for volume in spec["volumes"]:
            assert volume.get("persistentVolumeClaim", {}).get("claimName") in claims | {None}
        for container in spec["containers"]:
            assert container["securityContext"] == {
                "allowPrivilegeEscalation": False,
                "readOnlyRootFilesystem": True,
                "capabilities": {"drop": ["ALL"]},
            }
            assert {"startupProbe", "readinessProbe", "livenessProbe"} <= container.keys()
            assert container["resources"]["requests"]["memory"] == container["resources"]["limits"]["memory"]
            assert {mount["name"] for mount in container["volumeMounts"]} <= volumes
            for variable in container["env"]:
                if re.search(r"PASSWORD|AUTH_STRING|SECRET", variable["name"]) and "_FILE" not in variable["name"]:
                    assert "secretKeyRef" in variable["valueFrom"]


def commands() -> Iterator[list[str]]:
    """How Dask's workers are started, by compose and by Kubernetes."""
    yield shlex.split(COMPOSE["services"]["worker"]["command"])
    yield dict(pods())["worker"]["spec"]["template"]["spec"]["containers"][0]["args"]


@pytest.mark.parametrize("command", list(commands()), ids=["compose", "kubernetes"])
def test_workers_have_the_memory_that_units_declare(command: list[str]) -> None:
    """The largest of a picture, a page; a facade takes 190 bytes for a texel."""
    said = dict(zip(command, command[1:], strict=False))["--memory-limit"]
    shared_out = int(said.removesuffix("GB")) * 10**9 * UNITS_SHARE
    exemplar = MAX_EXEMPLAR_SIDE**2 * (memory.FACADE_TEXEL + memory.PICTURE_PIXEL)
    photo = MAX_PIXELS * memory.PICTURE_PIXEL + 4_000_000 * memory.FACADE_TEXEL
    for unit in (exemplar + memory.DETECTION_BYTES, photo + memory.DETECTION_BYTES, page_memory(MAX_PAGE_TEXELS**2)):
        assert memory.LIBRARY_BYTES + unit <= shared_out
    assert street_memory(600_000.0) <= shared_out
    for limit in (
        COMPOSE["services"]["worker"]["deploy"]["resources"]["limits"]["memory"],
        dict(pods())["worker"]["spec"]["template"]["spec"]["containers"][0]["resources"]["limits"]["memory"],
    ):
        given = int(re.match(r"\d+", limit)[0]) * 2**20  # type: ignore[index]
        assert given > int(said.removesuffix("GB")) * 10**9  # the nanny starts a worker anew before the kernel ends it


def test_the_parts_of_dask_are_told_of_their_certificates() -> None:
    known = settings(Path("/run")).keys()
    for service in ("scheduler", "worker", "runs"):
        assert known <= COMPOSE["services"][service]["environment"].keys()
    for name, role in (("scheduler", "SCHEDULER"), ("worker", "WORKER"), ("worker", "CLIENT"), ("runs", "CLIENT")):
        told = {one["name"] for one in dict(pods())[name]["spec"]["template"]["spec"]["containers"][0]["env"]}
        assert {key for key in known if f"__{role}__" in key} <= told
        assert "DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION" in told


def test_a_certificate_is_made_once_and_for_its_owner_alone(tmp_path: Path) -> None:
    from deploy.certificates import make

    make(tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {"ca.pem", "cert.pem", "key.pem"}
    assert {file.stat().st_mode & 0o777 for file in tmp_path.iterdir()} == {0o600}
    with pytest.raises(FileExistsError):
        make(tmp_path)
