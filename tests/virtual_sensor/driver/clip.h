// The frames of a sensor, read from a file: its layout is in clip.py.
#pragma once
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdint>
#include <cstring>

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

// Mapped, not read: a device is opened and closed many times, and its memory is not the program's.
struct Clip {
    ClipHeader head{};
    const char* images = nullptr;

    Clip() = default;
    Clip(const Clip&) = delete;
    ~Clip() {
        if (mapped_ != MAP_FAILED) munmap(mapped_, size_);
    }
    size_t depthSize() const { return size_t(2) * head.width * head.height; }
    size_t colorSize() const { return size_t(3) * head.width * head.height; }
    bool load(const char* path) {
        const int file = open(path, O_RDONLY | O_CLOEXEC);
        if (file < 0) return false;
        struct stat status{};
        if (!fstat(file, &status) && size_t(status.st_size) >= sizeof head) {
            size_ = size_t(status.st_size);
            mapped_ = mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, file, 0);
        }
        close(file);
        if (mapped_ == MAP_FAILED) return false;
        std::memcpy(&head, mapped_, sizeof head);
        images = static_cast<const char*>(mapped_) + sizeof head;
        return !std::memcmp(head.magic, "VSENSOR2", 8) && head.version == 2 && head.frames
            && size_ == sizeof head + head.frames * (depthSize() + colorSize());
    }
    const uint16_t* depth(size_t index) const {
        return reinterpret_cast<const uint16_t*>(images + index * (depthSize() + colorSize()));
    }
    const uint8_t* color(size_t index) const {
        return reinterpret_cast<const uint8_t*>(depth(index)) + depthSize();
    }

private:
    void* mapped_ = MAP_FAILED;
    size_t size_ = 0;
};
