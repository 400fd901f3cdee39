import hashlib
import json
import shutil
from pathlib import Path

import pytest

from facade_core.core.errors import ModelFileError
from facade_core.parsing import network


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for suffix in (".onnx", ".json"):
        shutil.copy(network.SHIPPED_NETWORK.with_suffix(suffix), tmp_path / f"network{suffix}")
    return tmp_path / "network.onnx"


def test_a_changed_file_is_refused(copy: Path) -> None:
    network.load_network(copy)
    content = bytearray(copy.read_bytes())
    content[len(content) // 2] ^= 1
    copy.write_bytes(content)
    with pytest.raises(ModelFileError, match="checksum"):
        network.load_network(copy)


def test_a_model_of_other_classes_is_refused(copy: Path) -> None:
    record = json.loads(copy.with_suffix(".json").read_text())
    copy.with_suffix(".json").write_text(json.dumps(record | {"classes": ["wall"]}))
    with pytest.raises(ModelFileError, match="other classes or features"):
        network.load_network(copy)


def test_broken_records_and_files_are_refused(copy: Path) -> None:
    record = json.loads(copy.with_suffix(".json").read_text())
    copy.with_suffix(".json").write_text("{")
    with pytest.raises(ModelFileError, match="not valid JSON"):
        network.load_network(copy)
    copy.write_bytes(b"no model")
    copy.with_suffix(".json").write_text(json.dumps(record | {"sha256": hashlib.sha256(b"no model").hexdigest()}))
    with pytest.raises(ModelFileError, match="onnxruntime"):
        network.load_network(copy)
    copy.with_suffix(".json").unlink()
    with pytest.raises(ModelFileError, match="no such file"):
        network.load_network(copy)


def test_the_shipped_model_is_small_and_described() -> None:
    assert network.SHIPPED_NETWORK.stat().st_size < 30e6
    assert network.SHIPPED_NETWORK.with_suffix(".md").is_file()
