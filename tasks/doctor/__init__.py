"""Diagnosis of the environment and of a run's folder."""

from tasks.doctor.findings import Finding
from tasks.doctor.folder import examine_folder
from tasks.doctor.machine import examine_machine

__all__ = ["Finding", "examine_folder", "examine_machine"]
