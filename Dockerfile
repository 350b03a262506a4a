# An image whose command is the demo. `docker build -t kinespace . && docker run --rm kinespace`
FROM python:3.12-slim AS built
RUN apt-get update && apt-get install --yes --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
COPY . /source
RUN pip wheel --no-deps --wheel-dir /wheels /source

FROM python:3.12-slim
COPY --from=built /wheels /wheels
RUN pip install --no-cache-dir /wheels/*.whl && useradd --create-home performer
USER performer
EXPOSE 9310/udp
CMD ["kinespace", "demo"]
