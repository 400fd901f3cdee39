"""An S3 server on loopback, moto's, in a process of its own: who waits for it within Icechunk may hold Python's lock."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import urllib3

# Environment variable of a file with a JSON list: a method, a part of a path, and what becomes of the next such request:
# "lose": it is done and not answered; "500", for as long as the file is there: it is refused.
FAULTS = "STREETLOOM_BUCKET_FAULTS"

# It ends when nobody holds its input any more. Requests are answered one by one: moto asks whether a condition holds and writes
# in two steps, between which a busy machine lets another write.
_SERVE = """
import json, logging, os, sys, threading
from pathlib import Path
from moto.moto_server import threaded_moto_server
from moto.server import ThreadedMotoServer
turn = threading.Lock()
faults = Path(os.environ.get("STREETLOOM_BUCKET_FAULTS", "/none"))
class InTurn(threaded_moto_server.DomainDispatcherApplication):
    def __call__(self, environ, start):
        method, part, what = json.loads(faults.read_text()) if faults.is_file() else ("", "", "")
        fails = method == environ["REQUEST_METHOD"] and part in environ["PATH_INFO"]
        if fails and what == "500":
            start("500 Internal Server Error", [("Content-Type", "application/xml")])
            return [b"<Error><Code>InternalError</Code></Error>"]
        with turn:
            answer = list(super().__call__(environ, start))
        if fails:
            faults.unlink()
            environ["werkzeug.socket"].shutdown(2)
        return answer
threaded_moto_server.DomainDispatcherApplication = InTurn
logging.getLogger("werkzeug").setLevel(logging.ERROR)
server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
server.start()
print(server.get_host_and_port()[1], flush=True)
sys.stdin.read()
server.stop()
"""


@contextmanager
def serving(bucket: str, key: str, secret: str) -> Iterator[Mapping[str, str]]:
    """An empty bucket; yields the environment by which it is found."""
    process = subprocess.Popen([sys.executable, "-c", _SERVE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        address = f"http://127.0.0.1:{int(process.stdout.readline())}"
        # its first answer takes the server seconds, in which it imports what it answers with
        asked = urllib3.PoolManager(retries=urllib3.Retry(connect=8, backoff_factor=0.1))
        made = asked.request("PUT", f"{address}/{bucket}", timeout=300)
        assert made.status == 200, made.data
        yield {
            "AWS_ENDPOINT_URL": address,
            "AWS_ACCESS_KEY_ID": key,
            "AWS_SECRET_ACCESS_KEY": secret,
            "AWS_REGION": "us-east-1",
            "AWS_EC2_METADATA_DISABLED": "true",
        }
    finally:
        process.stdin.close()
        process.wait(timeout=300)
        process.stdout.close()
