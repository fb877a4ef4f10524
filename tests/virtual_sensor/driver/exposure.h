// The colour camera's automatic exposure and white balance, which settle after the start.
#pragma once
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <vector>

// Share of its settled brightness that each channel begins with. Frame 2 of 30 has 0.5, 0.36, 0.2:
// dark, and red.
constexpr double kFirst[3] = {0.466, 0.316, 0.146};
constexpr int kSettledExposure = 100;  // what EXPOSURE reads when settled
constexpr double kBreathingPeriod = 40;  // frames

class Exposure {
public:
    std::atomic<bool> exposes{true}, balances{true};  // automatically

    // The stream starts: what is not locked begins anew.
    void restart() {
        if (exposes) exposed_ = 0;
        if (balances) balanced_ = 0;
        if (exposes) manual_ = 0;
    }
    // One frame goes by.
    void step(int64_t settles) {
        settles_ = settles;
        if (exposes) exposed_++;
        if (balances) balanced_++;
    }
    void set(int value) { manual_ = value; }
    int value(int64_t breathing) const { return int(std::lround(kSettledExposure * brightness(breathing))); }

    void light(std::vector<char>& rgb, int64_t breathing) const {
        double gain[3];
        bool plain = true;
        const double bright = brightness(breathing), green = ramp(kFirst[1], balanced_);
        for (int i = 0; i < 3; i++) {
            gain[i] = bright * ramp(kFirst[i], balanced_) / green;
            plain = plain && gain[i] == 1;
        }
        if (plain) return;
        uint8_t table[3][256];
        for (int i = 0; i < 3; i++)
            for (int value = 0; value < 256; value++)
                table[i][value] = uint8_t(std::min(255.0, gain[i] * value + 0.5));
        for (size_t at = 0; at < rgb.size(); at++) rgb[at] = char(table[at % 3][uint8_t(rgb[at])]);
    }

private:
    std::atomic<int64_t> settles_{0}, exposed_{0}, balanced_{0};
    std::atomic<int> manual_{0};  // 0: automatic

    double ramp(double first, int64_t frame) const {
        if (settles_ <= 0) return 1;
        return first + (1 - first) * std::min(1.0, double(frame) / double(settles_.load()));
    }
    // Of green; once settled it breathes, where it is asked to, as long as it is automatic.
    double brightness(int64_t breathing) const {
        if (manual_) return double(manual_) / kSettledExposure;
        const double phase = 2 * M_PI * double(exposed_.load()) / kBreathingPeriod;
        return ramp(kFirst[1], exposed_) * (1 + double(breathing) / 1000 * std::sin(phase));
    }
};
