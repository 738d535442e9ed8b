"""The compiler of kernels, and the storage of compiled code."""
