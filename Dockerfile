# ManipNet Live: docker build -t manipnet . && docker run --rm -p 5555:5555 manipnet
FROM python:3.12-slim

RUN useradd --create-home --uid 1000 manipnet
WORKDIR /opt/manipnet
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY server server
COPY tools tools
COPY models models
RUN pip install --no-cache-dir -c constraints.txt .

USER manipnet
WORKDIR /home/manipnet
ENV PYTHONUNBUFFERED=1
EXPOSE 5555 5556 5557 39540/udp 8080 8081

# The loopback address of a container is its own, so the server listens on all of its addresses. Publish only the ports
# that you need, and only to networks that you trust.
ENTRYPOINT ["manipnet-serve"]
CMD ["--demo", "--host", "0.0.0.0", "--insecure"]
