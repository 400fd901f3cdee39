"""Objects of a bucket, by the keys of a file as by those of the environment."""

from __future__ import annotations

from pathlib import Path

import pytest

from catalogs.published import object_store
from catalogs.published.s3 import S3Path
from facade_core.core.errors import InputError
from tests.bucket import KEY, SECRET, served


def test_keys_may_be_in_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with served("profiles") as bucket:
        monkeypatch.delenv("AWS_ACCESS_KEY_ID")
        monkeypatch.delenv("AWS_SECRET_ACCESS_KEY")
        file = tmp_path / "credentials"
        file.write_text(f"[night]\naws_access_key_id = {KEY}\naws_secret_access_key = {SECRET}\n")
        monkeypatch.setenv("AWS_SHARED_CREDENTIALS_FILE", str(file))
        monkeypatch.setenv("AWS_PROFILE", "night")
        object_store._open_store.cache_clear()
        try:
            tag = object_store.upload_if_unchanged("profiles/a", b"1", None)
            assert object_store.download_object("profiles/a") == (b"1", tag)
            assert object_store.list_objects("profiles").keys() == {"a"}
            assert S3Path("profiles/a").read_text() == "1"
            with pytest.raises(InputError, match="no such bucket"):
                object_store.upload_object("nobody-has-this/a", b"")
        finally:
            object_store._open_store.cache_clear()
        assert bucket == "s3://profiles"
