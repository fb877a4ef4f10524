# docker build -t denseface . && docker run --rm denseface --help      (see docs/operating.md)
FROM debian:12-slim AS build
RUN apt-get update \
    && apt-get install -y --no-install-recommends python3-venv \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /source
# Wheels of all dependencies, checked against the lock. What builds them is not installed.
COPY requirements requirements
RUN python3 -m venv /build \
    && /build/bin/pip install --no-cache-dir --require-hashes -r requirements/build.txt \
    && /build/bin/pip wheel --no-cache-dir --require-hashes --no-build-isolation --use-pep517 \
        --wheel-dir /wheels -r requirements/run.txt
COPY . .
RUN /build/bin/pip wheel --no-deps --no-build-isolation --wheel-dir /wheels . \
    && python3 -m venv /opt/denseface \
    && /opt/denseface/bin/pip install --no-index --no-deps /wheels/*.whl

FROM debian:12-slim
# The binding loads OpenNI2 by the unversioned name, which only Debian's -dev package holds.
RUN apt-get update \
    && apt-get install -y --no-install-recommends python3 libopenni2-0 \
        libegl1 libgl1 libgomp1 libidn2-0 libudev1 libusb-1.0-0 libx11-6 \
    && rm -rf /var/lib/apt/lists/* \
    && ln -s libOpenNI2.so.0 "$(dirname "$(dpkg -L libopenni2-0 | grep '/libOpenNI2\.so\.0$')")/libOpenNI2.so" \
    && useradd --create-home --uid 1000 --groups plugdev,video denseface \
    && install -d -o denseface -g denseface -m 0700 /data /faces
COPY --from=build /opt/denseface /opt/denseface
# The metrics' port is inside the container alone; the health check asks there.
ENV PATH=/opt/denseface/bin:$PATH \
    DENSEFACE_DATA=/data \
    DENSEFACE_METRICS=127.0.0.1:9400
# The kiosk's page, reached from outside only where DENSEFACE_KIOSK_ADDRESS says so.
EXPOSE 8080
# Compiled for this processor, for whoever the container runs as: else each start would compile it.
RUN denseface warm
USER denseface
# What users have written, apart from the hub's own: nothing there is removed.
WORKDIR /faces
VOLUME /data /faces
# Healthy where a press now would become a face.
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s --retries=3 CMD ["python3", "-IS", "-c", "import http.client, os; hub = http.client.HTTPConnection(os.environ['DENSEFACE_METRICS'], timeout=5); hub.request('GET', '/healthz'); raise SystemExit(hub.getresponse().status != 200)"]
ENTRYPOINT ["denseface"]
CMD ["up"]
