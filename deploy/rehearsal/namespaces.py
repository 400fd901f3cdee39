"""Network namespaces with one bridge between them, and processes in them; all of it ends with the process that made it."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path

# In a user, network and mount namespace of its own a process may make others, and no name or device of them is the machine's.
APART = ("unshare", "--user", "--map-root-user", "--net", "--mount", "--propagation", "private")
_TRY = "mount -t tmpfs none /run && mkdir /run/netns && ip link add name b type bridge && ip netns add a"
NETWORK = "10.73.0."
# Seconds for what is told to end, before it is killed.
ENDS_S = 20.0


def unfit() -> str | None:
    """Why no namespaces can be made here; None where they can."""
    try:
        tried = subprocess.run([*APART, "sh", "-c", _TRY], capture_output=True, text=True)
    except FileNotFoundError as error:
        return f"no network namespaces here: {error}"
    if tried.returncode:
        return f"no network namespaces here: {' '.join(tried.stderr.split()) or 'not allowed'}"
    return None


def apart(module: str, arguments: Sequence[str]) -> list[str]:
    """The command that runs a module where namespaces can be made."""
    ready = 'mount -t tmpfs none /run && mkdir /run/netns && exec "$@"'
    return [*APART, "sh", "-c", ready, "sh", sys.executable, "-m", module, *arguments]


def follow(by: int = signal.SIGKILL) -> None:
    """End with the process that started this one, however that ends, by a signal."""
    ctypes.CDLL(None).prctl(1, by)


@dataclass
class Namespaces:
    """Machines with an address each, joined by a bridge. logs: the folder of what their processes say."""

    logs: Path
    addresses: dict[str, str] = field(default_factory=dict)
    processes: dict[str, subprocess.Popen] = field(default_factory=dict)
    ends: ExitStack = field(default_factory=ExitStack)

    def __enter__(self) -> Namespaces:
        self.logs.mkdir(parents=True, exist_ok=True)
        _ip("link set lo up")
        _ip("link add name bridge type bridge")
        _ip(f"address add {NETWORK}1/24 dev bridge")
        _ip("link set bridge up")
        return self

    def __exit__(self, *_: object) -> None:
        for name in reversed(list(self.processes)):
            self.end(name)
        self.ends.close()

    def machine(self, name: str) -> str:
        """A new one; returns its address."""
        address = f"{NETWORK}{len(self.addresses) + 2}"
        _ip(f"netns add {name}")
        _ip(f"link add {name} type veth peer name inside netns {name}")
        _ip(f"link set {name} master bridge")
        _ip(f"link set {name} up")
        _ip(f"-n {name} address add {address}/24 dev inside")
        _ip(f"-n {name} link set inside up")
        _ip(f"-n {name} link set lo up")
        self.addresses[name] = address
        return address

    def within(self, name: str) -> list[str]:
        """The beginning of a command that is to run on a machine."""
        return ["ip", "netns", "exec", name]

    def start(self, machine: str, name: str, command: Sequence[str], environment: Mapping[str, str], cwd: Path) -> None:
        with (self.logs / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(
                [*self.within(machine), *command],
                cwd=cwd,
                env=dict(environment),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=follow,
            )

    def cut(self, name: str) -> None:
        """Nothing that is sent to a machine or by it arrives, and nobody is told."""
        _ip(f"link set {name} down")

    def heal(self, name: str) -> None:
        _ip(f"link set {name} up")

    def kill(self, name: str) -> None:
        """End a process, and what it started, at once."""
        process = self.processes.pop(name)
        os.killpg(process.pid, 9)
        process.wait()

    def end(self, name: str) -> None:
        """Tell a process to end, as an orchestrator does, and kill what does not."""
        process = self.processes.pop(name)
        process.terminate()
        deadline = time.monotonic() + ENDS_S
        while process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, 9)
        process.wait()


def _ip(words: str) -> None:
    subprocess.run(["ip", *words.split()], check=True, capture_output=True, text=True)
