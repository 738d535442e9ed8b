"""The likelihood of readings for given parameters.

`objective` has the problem, and the objective that a search maximises. `echo_likelihood` is its kernel. The others
compute what the kernel needs: `echo_paths` paths that follow place and walls, `edge_powers` and `rough_paths` their
levels, `lateness` the delay of faint echoes, and `setting_numbers` board, pose and air. `tolerance_prior` is the prior
of values that are not free.
"""
