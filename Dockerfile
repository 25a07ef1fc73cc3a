FROM debian:trixie-slim

ARG DEBIAN_FRONTEND=noninteractive
RUN apt-get update \
 && apt-get install -y --no-install-recommends \
      python3-dolfinx python3-dolfinx-real python3-dolfinx-complex \
      python3-petsc4py python3-slepc4py python3-gmsh python3-meshio python3-h5py \
      python3-scipy python3-matplotlib python3-pytest \
      libopenblas0-serial gcc libc6-dev openmpi-bin \
 && rm -rf /var/lib/apt/lists/*

# /results is the one folder that a run writes into: a user whom the image does not know (docker run --user) must be able
# to, and so must the temporary files of MPI, the C compiler and Python where everything else is read-only.
RUN useradd --uid 1000 --home-dir / --no-create-home uplift \
 && install -d -o uplift -g uplift /opt/uplift-cache /opt/uplift-cache/matplotlib \
 && install -d -o uplift -g uplift -m 1777 /results
# The ranks of a container share its memory; without ^tcp Open MPI also looks for network interfaces, and complains of them.
ENV PYTHONPATH=/opt/uplift \
    PYTHONDONTWRITEBYTECODE=1 \
    HOME=/ \
    TMPDIR=/results \
    XDG_CACHE_HOME=/opt/uplift-cache \
    MPLCONFIGDIR=/opt/uplift-cache/matplotlib \
    OMP_NUM_THREADS=1 \
    OPENBLAS_NUM_THREADS=1 \
    OMPI_ALLOW_RUN_AS_ROOT=1 \
    OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 \
    OMPI_MCA_btl=^tcp

COPY . /opt/uplift
RUN python3 -m compileall -q /opt/uplift

# Compiled forms and matplotlib's list of fonts belong to the image: no run has to make them again. The forms depend on the
# kinematics, the cells, their degree and on real or complex numbers, not on the values in a scene, so that scenes of the user's own find
# theirs. A sweep of two frequencies is enough for the complex ones.
USER uplift
RUN set -e; \
    scenes=/opt/uplift/drivers/scenes; \
    for cell in quadrilateral triangle; do for degree in 1 2; do \
      sed -e "s/^cell = \"[a-z]*\"/cell = \"$cell\"/" -e "s/^degree = [0-9]/degree = $degree/" \
        $scenes/sdls119a.toml > /results/$cell-$degree.toml; \
    done; done; \
    sed '/^\[mesh\]/a cell = "triangle"' $scenes/box.toml > /results/box-triangle.toml; \
    sed -e '/^\[mesh\]/a cell = "triangle"' -e 's/^nx = 5/nx = 10/' -e 's/^ny = 5/ny = 10/' \
      $scenes/raft.toml > /results/raft-triangle.toml; \
    for scene in $scenes/*.toml /results/*.toml; do \
      cp "$scene" /results/warm-up; \
      if ! grep -q '^\[fourier\]' "$scene"; then \
        printf '\n[fourier]\nlength = 1.0\nsamples = 4\ncutoff = 1.0\n' >> /results/warm-up; fi; \
      for method in transient time-frequency; do \
        python3 -m drivers run /results/warm-up --method $method --iterations 1 --no-plots --quiet --out "/results/run$scene/$method"; \
      done; \
    done; \
    python3 -m drivers verify --out /results/verify; \
    find /results -mindepth 1 -delete
# Compiled forms are run: they belong to root, so that any user may trust them.
USER root
RUN chown -R root:root /opt/uplift-cache
USER uplift

# The default folder results/... lies below here: /results.
WORKDIR /
VOLUME /results
# As the first process of a container Python would not hear the usual SIGTERM; an interrupt it does.
STOPSIGNAL SIGINT
ENTRYPOINT ["python3", "-m", "drivers"]
CMD ["verify"]
