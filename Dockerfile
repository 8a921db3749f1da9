# Debian 12 with all that continuous integration installs; docs/release.md describes its use. The stage `tools` is the
# development container, for a mounted checkout; the last one holds this checkout, set up and compiled.
ARG BASE=docker.io/library/debian:bookworm-20260918@sha256:f37a335e82bca302e955fa39f9dfe28f1be618f016f8a2b56318e5a5111afc26
FROM ${BASE} AS tools
COPY tools/programs.sh tools/system-packages tools/test-packages /opt/colonnade/tools/
RUN apt-get update \
  && apt-get install -y --no-install-recommends ca-certificates git make \
  && /opt/colonnade/tools/system-packages \
  && rm -rf /var/lib/apt/lists/* /var/cache/apt/* /opt/colonnade/.cache
RUN apt-get update \
  && /opt/colonnade/tools/test-packages \
  && rm -rf /var/lib/apt/lists/* /var/cache/apt/* /opt/colonnade/.cache
RUN useradd --create-home --shell /bin/bash colonnade && install -d -o colonnade -g colonnade /colonnade
ENV LANG=C.UTF-8 PIP_NO_CACHE_DIR=1 UV_NO_CACHE=1
USER colonnade

FROM tools
WORKDIR /colonnade
# The packages of the locks change more rarely than the sources: a layer of their own.
COPY --chown=colonnade:colonnade host/locks host/locks
COPY --chown=colonnade:colonnade tools/programs.sh tools/python-environment tools/fetch-sbt tools/
RUN tools/fetch-sbt && tools/python-environment --packages
COPY --chown=colonnade:colonnade . .
# The generator is compiled at its first use.
RUN tools/setup && .venv/bin/colonnade generate --config small --output /tmp/small && rm -rf /tmp/small
ENV PATH=/colonnade/.venv/bin:$PATH
CMD ["bash"]
