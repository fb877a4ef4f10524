// The dense cloud of a `face_done`, as text: for each point x y z (mm) red green blue sigma (mm).
#pragma once
#include <cmath>
#include <cstring>
#include <sstream>
#include <stdexcept>
#include <vector>
#include <nlohmann/json.hpp>
#include <zmq.hpp>

using Json = nlohmann::json;

struct Message {
    Json header = Json::object();
    std::vector<zmq::message_t> arrays;
};

inline void check(bool is_so, const std::string& why) {
    if (!is_so) throw std::runtime_error(why);
}

template <class T> T element(const zmq::message_t& array, size_t i) {  // a part is not aligned
    T value;
    std::memcpy(&value, array.data<char>() + i * sizeof(T), sizeof(T));
    return value;
}

inline std::string points_of(const Message& done) {
    const auto& [header, arrays] = done;
    const Json& face = header.at("face");
    const size_t n = face["initial_points"], m = face["dense_points"];
    const size_t rows = face["grid_shape"].at(0), columns = face["grid_shape"].at(1);
    const size_t row_bytes = (columns + 7) / 8;
    const std::vector<size_t> sizes = {12 * n, 3 * n, rows * row_bytes, 4 * columns, 4 * rows,
                                       4 * m, 3 * m, 4 * m, 2 * m};
    check(arrays.size() == sizes.size(), "the face has another number of arrays");
    for (size_t i = 0; i < sizes.size(); ++i)
        check(arrays[i].size() == sizes[i], "array " + std::to_string(i) + " is not as told");
    const auto &support = arrays[2], &x = arrays[3], &y = arrays[4], &z = arrays[5];
    const auto &colors = arrays[6], &sigma = arrays[8];
    std::ostringstream out;
    out.precision(9);  // enough for every float32
    size_t i = 0;
    for (size_t row = 0; row < rows; ++row)
        for (size_t column = 0; column < columns; ++column) {
            const int bits = element<uint8_t>(support, row * row_bytes + column / 8);
            if (!(bits & 128 >> column % 8)) continue;  // no point there
            check(i < m, "there are more points than told");
            out << element<float>(x, column) << ' ' << element<float>(y, row) << ' '
                << element<float>(z, i);
            for (size_t channel = 0; channel < 3; ++channel)
                out << ' ' << int(element<uint8_t>(colors, 3 * i + channel));
            const int half = element<uint16_t>(sigma, i), rest = half % 1024;  // float16, above 0
            out << ' ' << (half < 1024 ? std::ldexp(rest, -24)
                                       : std::ldexp(1024 + rest, half / 1024 - 25)) << '\n';
            ++i;
        }
    check(i == m, "there are fewer points than told");
    return out.str();
}
