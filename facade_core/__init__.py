"""The algorithms of Streetloom: arrays in, arrays out."""

import os

# onnxruntime sends usage data to its maker from its first import on; nothing of a user's work leaves the machine.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
