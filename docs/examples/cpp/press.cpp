// Press once, follow the faces until one's own is there, and write it as ID.xyz.
//   ./press ADDRESS [OWN.secret HUB.public]
#include <chrono>
#include <fstream>
#include <iostream>
#include <random>
#include <zmq_addon.hpp>
#include "face.hpp"

void connect(zmq::socket_t& socket, const std::string& address, int argc, char** argv) {
    socket.set(zmq::sockopt::rcvtimeo, 2000);
    socket.set(zmq::sockopt::rcvhwm, 16);
    socket.set(zmq::sockopt::maxmsgsize, 1L << 25);
    socket.set(zmq::sockopt::linger, 0);
    if (argc == 4) {
        const Json own = Json::parse(std::ifstream(argv[2]));
        const Json hub = Json::parse(std::ifstream(argv[3]));
        socket.set(zmq::sockopt::curve_publickey, own["public_key"].get<std::string>());
        socket.set(zmq::sockopt::curve_secretkey, own["secret_key"].get<std::string>());
        socket.set(zmq::sockopt::curve_serverkey, hub["public_key"].get<std::string>());
    }
    socket.connect(address);
}

Message receive(zmq::socket_t& socket, int topics = 0) {  // {} after two silent seconds
    static const auto give_up = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    check(std::chrono::steady_clock::now() < give_up, "no face: no hub there? a key not allowed?");
    Message got;
    if (!zmq::recv_multipart(socket, std::back_inserter(got.arrays))) return got;
    got.header = Json::parse(got.arrays.at(topics).to_string_view());
    got.arrays.erase(got.arrays.begin(), got.arrays.begin() + topics + 1);
    return got;
}

Message request(zmq::socket_t& dealer, Json said) {
    static int number = 0;
    said.update({{"version", 2}, {"request", ++number}});
    for (Message answer;; answer = receive(dealer)) {
        if (answer.header.empty())  // and again, until it is answered
            dealer.send(zmq::buffer(said.dump()), zmq::send_flags::dontwait);
        if (answer.header.value("request", 0) != number) continue;
        check(answer.header["kind"] != "request_failed", answer.header.value("message", ""));
        return answer;
    }
}

int main(int argc, char** argv) try {
    check(argc == 2 || argc == 4, "usage: press ADDRESS [OWN.secret HUB.public]");
    const std::string address = argv[1], host = address.substr(0, address.rfind(':') + 1);
    zmq::context_t context;
    zmq::socket_t dealer(context, ZMQ_DEALER), subscriber(context, ZMQ_SUB);
    connect(dealer, address, argc, argv);
    connect(subscriber, host == "ipc:" ? address + ".publications" :
            host + std::to_string(std::stoi(address.substr(host.size())) + 1), argc, argv);
    subscriber.set(zmq::sockopt::subscribe, "faces");
    const Json start = request(dealer, {{"kind", "find_start"}, {"last", 1}}).header;
    std::string epoch = start["epoch"];
    uint64_t sequence = start["sequence"];
    std::random_device random;
    const std::string id = std::to_string(uint64_t(random()) << 32 | random());
    const Json pressed = request(dealer, {{"kind", "press"}, {"capture_id", id}}).header;
    check(pressed["kind"] == "press_accepted", pressed.value("message", ""));
    for (bool behind = true;;) {  // whether outcomes may have been missed: those are asked for
        const auto got = behind ? request(dealer, {{"kind", "get_next"}, {"after", sequence}})
                                : receive(subscriber, 1);
        const bool same = got.header.value("epoch", "") == epoch;
        const uint64_t number = got.header.value("sequence", uint64_t(0));
        const std::string kind = got.header.value("kind", "");
        const std::string of = got.header.value("capture_id", "");
        if (!behind && !(same && number == sequence + 1)) behind = true;
        else if (!same) epoch = got.header["epoch"], sequence = 0;  // another store
        else if (sequence = number; kind == "nothing_newer") behind = false;
        else if (std::cout << of << ": " << kind << std::endl; of == id) {
            check(kind == "face_done", got.header.value("message", ""));
            const std::string points = points_of(got);
            return std::ofstream(id + ".xyz") << points << std::flush ? 0 : 1;
        }
    }
} catch (const std::exception& error) { return std::cerr << error.what() << std::endl, 1; }
