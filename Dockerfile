# docker build -t denseface . && docker run --rm denseface --help      (docs/container.md)
# What it stands on. Pinned: --build-arg BASE=debian:12-slim@sha256:..., as script/image says it.
ARG BASE=debian:12-slim

FROM ${BASE} AS build
# By which `script/image --remove` finds what is kept of it.
LABEL denseface.stage=build
# What is installed: `image` is all that the service runs, `run` has Open3D too, for programs that
# go on with a face.
ARG LOCK=image
# Secrets are files of this machine's that may be there while something is fetched, and are in no
# image: how packages are reached, as through a mirror. `script/image` gives them.
RUN --mount=type=secret,id=apt.conf --mount=type=secret,id=sources.list --mount=type=secret,id=ca.crt \
    export APT_CONFIG=/run/secrets/apt.conf \
    && apt-get update \
    && apt-get install -y --no-install-recommends python3-venv \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /source
# Wheels of all dependencies, checked against the lock. What builds them is not installed.
COPY requirements requirements
RUN --mount=type=secret,id=pip.conf --mount=type=secret,id=ca.crt \
    export PIP_CONFIG_FILE=/run/secrets/pip.conf \
    && python3 -m venv /build \
    && /build/bin/pip install --no-cache-dir --require-hashes -r requirements/build.txt \
    && /build/bin/pip wheel --no-cache-dir --require-hashes --no-build-isolation --use-pep517 \
        --wheel-dir /wheels -r "requirements/$LOCK.txt"
# Without pip, and without the tests of the largest packages: 30 MB.
RUN python3 -m venv --without-pip /opt/denseface \
    && /build/bin/pip --python /opt/denseface/bin/python install --no-index --no-deps --no-compile \
        /wheels/*.whl \
    && cd /opt/denseface/lib/python3*/site-packages \
    && find numba numpy scipy -depth -type d -name tests -exec rm -r {} +
COPY . .
RUN --mount=type=secret,id=npmrc --mount=type=secret,id=ca.crt \
    export NPM_CONFIG_USERCONFIG=/run/secrets/npmrc \
    && /build/bin/pip wheel --no-deps --no-build-isolation --wheel-dir /own ./distributions/core \
    && /build/bin/pip --python /opt/denseface/bin/python install --no-index --no-deps --no-compile \
        /own/*.whl
# Compiled here, as nobody can write it later: modules whatever the times of their files, and the
# kernels for this processor, for whoever the container runs as.
RUN /opt/denseface/bin/python -m compileall -q --invalidation-mode unchecked-hash /opt/denseface/lib \
    && /opt/denseface/bin/denseface warm

FROM ${BASE}
ARG LOCK=image
LABEL org.opencontainers.image.title="denseface" \
    org.opencontainers.image.description="One press, one depth frame, one dense coloured 3D face" \
    org.opencontainers.image.licenses="Apache-2.0"
# The binding loads OpenNI2 by the unversioned name, which only Debian's -dev package holds. Open3D
# links to what draws. /data, /faces and /run/denseface are as /tmp is: any user may make files of
# its own there. No program makes anybody root.
RUN --mount=type=secret,id=apt.conf --mount=type=secret,id=sources.list --mount=type=secret,id=ca.crt \
    export APT_CONFIG=/run/secrets/apt.conf \
    && apt-get update \
    && apt-get install -y --no-install-recommends python3 libopenni2-0 tini \
        $([ "$LOCK" = image ] || echo libegl1 libgl1 libgomp1 libidn2-0 libx11-6) \
    && rm -rf /var/lib/apt/lists/* \
    && find /var/cache /var/log -type f -delete \
    && ln -s libOpenNI2.so.0 "$(dirname "$(dpkg -L libopenni2-0 | grep '/libOpenNI2\.so\.0$')")/libOpenNI2.so" \
    && find / -xdev -type f -perm /6000 -exec chmod ug-s {} + \
    && install -d -m 1777 /data /faces /run/denseface
COPY --from=build /opt/denseface /opt/denseface
# What is kept, of whoever the container runs as: keys, calibrations, the kiosk's and compiled code
# for another processor below /data, too.
ENV PATH=/opt/denseface/bin:/usr/local/bin:/usr/bin:/bin \
    HOME=/data \
    DENSEFACE_DATA=/data/hub
# The kiosk's page, reached from outside only where DENSEFACE_KIOSK_ADDRESS says so.
EXPOSE 8080
USER 1000:0
# What users have written, apart from the hub's own: nothing there is removed.
WORKDIR /faces
VOLUME /data /faces
# Healthy where a press now would become a face.
HEALTHCHECK --interval=30s --timeout=10s --start-period=120s --retries=3 \
    CMD ["denseface", "status", "--healthy"]
# As the first process Python would ignore a signal until it is up, and leave orphans unreaped.
ENTRYPOINT ["tini", "-s", "--", "denseface"]
CMD ["up"]
