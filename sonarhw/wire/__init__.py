"""The wire protocol: frames, messages and the readings they carry."""
