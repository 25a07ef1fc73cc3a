"""Tests of the package, in the order of its rooms."""

import os

OF_A_SINGLE_PROCESS = ("OMPI_APP", "OMPI_MCA_ess", "OMPI_MCA_orte", "OMPI_MCA_pmix", "ORTE_")
"""Beginnings of the variables that MPI sets in a process which no launcher has started; mpirun below it would fail without a word."""

if "PYTEST_XDIST_WORKER" in os.environ:  # a child of such a process
    for name in [name for name in os.environ if name.startswith(OF_A_SINGLE_PROCESS)]:
        del os.environ[name]
