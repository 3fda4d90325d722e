# ManipNet Live: docker build -t manipnet . && docker run --rm --network host manipnet
FROM python:3.12-slim

RUN useradd --create-home --uid 1000 manipnet
WORKDIR /opt/manipnet
COPY pyproject.toml hatch_build.py constraints.txt README.md LICENSE ./
COPY server server
COPY tools tools
COPY models models
RUN pip install --no-cache-dir -c constraints.txt . ./models
# Installing has compiled the kernels for the newest numba; this does so for the one of constraints.txt if that is another.
RUN MANIPNET_CACHE=/tmp/manipnet python -m manipnet.runtime.precompile && rm -r /tmp/manipnet

USER manipnet
WORKDIR /home/manipnet
ENV PYTHONUNBUFFERED=1
EXPOSE 5555 5556 5557 39540/udp 8080 8081

# The server listens on the loopback address, so it is reached from the same machine with `--network host`. A container
# with a network of its own must be opened on purpose; docs/operations.md has the command.
ENTRYPOINT ["manipnet-serve"]
CMD ["--demo"]
