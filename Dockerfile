# Debian 13's DOLFINx with legfem in it, and the tests' browser. Not built in CI.
#
#   docker build -t legfem .
#   docker run --rm -v "$PWD:/data" legfem python -m legfem.identify --subject-dir /data/my-subject --out /data/out
FROM debian:trixie

COPY scripts/packages-debian.txt scripts/packages-pypi.txt scripts/packages-pypi.lock scripts/in-env /legfem/scripts/
RUN apt-get update \
    && sed 's/#.*//' /legfem/scripts/packages-debian.txt \
        | DEBIAN_FRONTEND=noninteractive xargs apt-get install -y --no-install-recommends \
    && rm -rf /var/lib/apt/lists/*

# A venv over Debian's python3, with what comes from PyPI.
ENV LEGFEM_CACHE=/opt/legfem
RUN /legfem/scripts/in-env true

COPY . /legfem
WORKDIR /data
ENTRYPOINT ["/legfem/scripts/in-env"]
CMD ["python", "-m", "legfem", "--help"]
