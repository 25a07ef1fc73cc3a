# Debian's dolfinx belongs to Debian's own python3, whatever other python3 stands earlier on PATH.
PYTHON = /usr/bin/python3

# OpenBLAS without threads of its own makes dense products several times as fast as the reference BLAS that would come otherwise.
PACKAGES = python3-dolfinx python3-dolfinx-real python3-dolfinx-complex \
  python3-petsc4py python3-slepc4py python3-gmsh python3-meshio python3-h5py \
  python3-scipy python3-matplotlib python3-pytest \
  libopenblas0-serial gcc libc6-dev openmpi-bin

# Tests read the report in a browser and run on all cores; nothing else needs either.
TEST_PACKAGES = chromium chromium-driver python3-pytest-xdist

# Prints the options that share the tests out among the cores, file by file; nothing where pytest-xdist is missing.
WORKERS = $(PYTHON) -c 'import xdist' 2>/dev/null && printf '%s' '-n auto --maxprocesses=8 --dist=loadfile' || :

# One thread a process: MPI brings the parallelism, and threads of BLAS beside it only compete for the same cores.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# mpirun refuses root unless it is told twice.
export OMPI_ALLOW_RUN_AS_ROOT = 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM = 1

# Installs those of the named packages that are missing; where none is, neither apt nor sudo is called.
define install
@missing=; \
for package in $(1); do \
  dpkg-query -W -f='$${db:Status-Status}\n' $$package 2>/dev/null | grep -qx installed || missing="$$missing $$package"; \
done; \
test -n "$$missing" || exit 0; \
echo "installing$$missing"; \
if test "$$(id -u)" = 0; then sudo=; else sudo=sudo; fi; \
$$sudo apt-get -q update && \
$$sudo env DEBIAN_FRONTEND=noninteractive apt-get -q install -y --no-install-recommends $$missing
endef

.PHONY: run test check image lint help packages

run: packages
	$(PYTHON) -m drivers verify

test: packages
	$(call install,$(TEST_PACKAGES))
	$(PYTHON) -m pytest -m 'not check' $$($(WORKERS))

check: packages
	$(call install,$(TEST_PACKAGES))
	$(PYTHON) -m pytest -m check $$($(WORKERS))

image:
	@for engine in docker podman; do \
	  if $$engine info >/dev/null 2>&1; then set -x; exec $$engine build -t uplift .; fi; \
	done; \
	echo "make image: neither docker nor podman answers" >&2; exit 1

lint: .venv/bin/mypy
	.venv/bin/ruff check
	mkdir -p .lint && ln -sfn .. .lint/uplift
	.venv/bin/mypy

# The virtual environment sees Debian's packages, so that mypy can follow imports of numpy.
.venv/bin/mypy: | packages
	$(call install,python3-venv)
	$(PYTHON) -m venv --system-site-packages .venv
	.venv/bin/pip install --quiet ruff==0.17.6 mypy==2.4.1

packages:
	$(call install,$(PACKAGES))

help:
	@echo 'make        the same as make run'
	@echo 'make run    install what is missing, rerun SDLS119 and compare the published values'
	@echo 'make test   install what is missing and a browser for the report, run the tests'
	@echo 'make check  run the longer tests: commands of the documentation, kills, pages of evidence, other processors'
	@echo 'make image  build the container image uplift with docker or podman'
	@echo 'make lint   ruff and mypy, in .venv'
	@echo 'make help   this list'
