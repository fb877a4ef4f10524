// The frames of a sensor, read from a file: its layout is in clip.py.
#pragma once
#include <cstdint>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

struct Camera {
    double fx, fy, cx, cy, k1, k2, p1, p2, k3;
};

struct ClipHeader {
    char magic[8];
    uint32_t version, frames, width, height;
    uint64_t zpd;
    double zpps, lddis, dcrcdis;
    float depthFov[2], colorFov[2];
    Camera depth, color;
    double rotation[9], translation[3];
};

struct Clip {
    ClipHeader head{};
    std::vector<char> bytes;

    size_t depthSize() const { return size_t(2) * head.width * head.height; }
    size_t colorSize() const { return size_t(3) * head.width * head.height; }
    bool load(const std::string& path) {
        std::ifstream file(path, std::ios::binary);
        if (!file.read(reinterpret_cast<char*>(&head), sizeof head)) return false;
        if (std::memcmp(head.magic, "VSENSOR2", 8) || head.version != 2 || !head.frames) return false;
        bytes.resize(head.frames * (depthSize() + colorSize()));
        return bool(file.read(bytes.data(), std::streamsize(bytes.size())));
    }
    const uint16_t* depth(size_t index) const {
        return reinterpret_cast<const uint16_t*>(bytes.data() + index * (depthSize() + colorSize()));
    }
    const uint8_t* color(size_t index) const {
        return reinterpret_cast<const uint8_t*>(depth(index)) + depthSize();
    }
};
