"""Three sweeps by stepwell, by numba with joblib, and by heyoka's ensembles: time, lines, memory, and how many are right."""
