"""Reproduction: a peer that guesses a ROUTER's next routing id aborts the process. Plain pyzmq.

Seen with libzmq 4.3.5. A ROUTER numbers peers without a routing id of their own: a zero byte and a
32-bit counter (`router_t::identify_peer`). It does not look whether a peer has chosen that id
itself, and asserts that nobody has (`routing_socket_base_t::add_out_pipe`). The counter starts at
`rand()`, which libzmq does not seed: the first id of a process is always 00 6b8b4567.

Run it: the process ends with SIGABRT. "not reproduced" means that libzmq is mended.
"""

import zmq

_LIMIT_MS = 20_000


def main() -> None:
    context = zmq.Context()
    router = context.socket(zmq.ROUTER)
    port = router.bind_to_random_port("tcp://127.0.0.1")

    peers = []  # open until the end: an id is taken as long as its connection lives

    def connect(routing_id: bytes | None = None) -> bytes:
        peer = context.socket(zmq.DEALER)
        if routing_id:
            peer.set(zmq.ROUTING_ID, routing_id)
        peer.connect(f"tcp://127.0.0.1:{port}")
        peers.append(peer)
        peer.send(b"")
        if not router.poll(_LIMIT_MS):
            raise TimeoutError("no message")
        return router.recv_multipart()[0]

    last = int.from_bytes(connect()[1:], "big")
    connect(b"\0" + (last + 1).to_bytes(4, "big"))
    connect()
    print("not reproduced")


if __name__ == "__main__":
    main()
