"""Make the certificate by which the parts of a Dask cluster know each other, and its key, into a folder.

python -m deploy.certificates FOLDER
"""

from __future__ import annotations

import os
from pathlib import Path

import click

# Dask's settings for TLS, by file; every part of a cluster has the same.
FILES = {"ca.pem": "tls_ca_file", "cert.pem": "tls_client_cert", "key.pem": "tls_client_key"}


def settings(folder: Path) -> dict[str, str]:
    """The environment of a part of the cluster whose files are in a folder."""
    tls = "DASK_DISTRIBUTED__COMM__TLS__"
    parts = ("SCHEDULER", "WORKER", "CLIENT")
    return {
        "DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION": "True",
        "DASK_DISTRIBUTED__COMM__DEFAULT_SCHEME": "tls",
        f"{tls}CA_FILE": str(folder / "ca.pem"),
        **{f"{tls}{part}__CERT": str(folder / "cert.pem") for part in parts},
        **{f"{tls}{part}__KEY": str(folder / "key.pem") for part in parts},
    }


@click.command()
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path))
def main(folder: Path) -> None:
    """Make ca.pem, cert.pem and key.pem in FOLDER, which hold for a year; none is replaced."""
    make(folder)


def make(folder: Path) -> None:
    from distributed.security import Security

    folder.mkdir(parents=True, exist_ok=True)
    security = Security.temporary()
    for name, part in FILES.items():
        file = os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(file, "w") as pem:
            pem.write(getattr(security, part))


if __name__ == "__main__":
    main()
