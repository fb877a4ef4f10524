// The control channel as the driver sees it: mapped files, or memory filled from the environment.
#pragma once
#include <fcntl.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "control_layout.h"

inline std::string env(const char* name, const char* otherwise = "") {
    const char* value = std::getenv((std::string("VIRTUAL_SENSOR_") + name).c_str());
    return value && *value ? value : otherwise;
}

// So that a measurement can leave the sensor's own work out.
inline void nameThread() { pthread_setname_np(pthread_self(), "virtual-sensor"); }

inline int64_t nowNs() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
        std::chrono::steady_clock::now().time_since_epoch()).count();
}

template <size_t N> void setText(char (&text)[N], const std::string& value) {
    std::strncpy(text, value.c_str(), N - 1);
}

// Counts one down; true where there was one. -1 stays: for ever.
inline bool take(std::atomic<int64_t>& left) {
    const int64_t had = left;
    if (had > 0) left = had - 1;
    return had != 0;
}

// In a call of the library: waits as long as the test says that this call hangs.
inline void mayHang(Control& control, int64_t call) {
    if (!(control.device.hang & call)) return;
    control.device.entered++;
    control.device.hanging |= call;
    while (control.device.hang & call) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    control.device.hanging &= ~call;
}

inline Control* mapped(const std::string& path) {
    const int file = open(path.c_str(), O_RDWR | O_CLOEXEC);
    if (file < 0) return nullptr;
    struct stat status{};
    void* memory = MAP_FAILED;
    if (!fstat(file, &status) && status.st_size == off_t(sizeof(Control)))
        memory = mmap(nullptr, sizeof(Control), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    return memory == MAP_FAILED ? nullptr : static_cast<Control*>(memory);
}

// One for each device. Those from files stay mapped as long as the process lives.
inline std::vector<Control*> findControls() {
    std::vector<Control*> found;
    const std::string paths = env("CONTROL");
    for (size_t from = 0; from < paths.size();) {
        const size_t to = std::min(paths.find(':', from), paths.size());
        if (Control* one = mapped(paths.substr(from, to - from))) found.push_back(one);
        from = to + 1;
    }
    if (!paths.empty() || env("FRAMES").empty()) return found;
    static Control simple;
    setText(simple.device.clip, env("FRAMES"));
    simple.device.loop = env("END", "loop") == "loop";
    simple.device.unplug_after = std::atoll(env("DISCONNECT_AFTER", "-1").c_str());
    simple.device.skips = false;
    simple.color.delay_us = std::atoll(env("SKEW_US", "0").c_str());
    simple.depth.present = env("STREAMS", "both") != "color";
    simple.color.present = env("STREAMS", "both") != "depth";
    if (env("DEPTH_UNIT") == "100um") setText(simple.depth.modes, "640x480@30:100um");
    found.push_back(&simple);
    return found;
}
