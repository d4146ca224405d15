"""Families of boards, a folder each: its bytes (`wire`, no I/O), its driver and its emulation; shared parts beside."""
