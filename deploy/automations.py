"""Make the automations of deploy/automations.yaml on the Prefect server at PREFECT_API_URL, or bring them up to date.

python deploy/automations.py [FILE] [--notify TYPE/NAME]
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
from ruamel.yaml import YAML

NOTIFY = "NOTIFY"


@click.command()
@click.argument("file", type=click.Path(exists=True, path_type=Path), default=Path(__file__).with_suffix(".yaml"))
@click.option("--notify", metavar="TYPE/NAME", help="A notification block, such as slack-webhook/team.")
def main(file: Path, notify: str | None) -> None:
    """Make the automations of a file, or bring those of the same names up to date."""
    from prefect.client.orchestration import SyncPrefectClient
    from prefect.events.schemas.automations import AutomationCore
    from prefect.settings import get_current_settings

    address = get_current_settings().api.url
    if not address:
        raise click.UsageError("PREFECT_API_URL names no server")
    with SyncPrefectClient(address) as client:
        block = _block(client, notify) if notify else None
        for entry in YAML(typ="safe").load(file.read_text()):
            text = json.dumps(entry)
            if NOTIFY in text and block is None:
                click.echo(f"left out, since no --notify is given: {entry['name']}")
                continue
            made = AutomationCore.model_validate_json(text.replace(NOTIFY, str(block)))
            for old in client.read_automations_by_name(made.name):
                client.delete_automation(old.id)
            client.create_automation(made)
            click.echo(f"made: {made.name}")


def _block(client: Any, notify: str) -> Any:
    from prefect.exceptions import ObjectNotFound

    kind, _, name = notify.partition("/")
    try:
        return client.read_block_document_by_name(name, kind).id
    except ObjectNotFound:
        raise click.UsageError(f"--notify {notify}: no such block; `prefect block ls` lists them") from None


if __name__ == "__main__":
    main()
