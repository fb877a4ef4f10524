// From a frame of the clip to what the sensor would send: registered, scaled, lit, encoded.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "OniCTypes.h"
#include "clip.h"
#include "modes.h"

// Where a mode's rows and columns are in the clip. A mode that is less high than its width asks for
// shows the middle (640x400), one that is higher shows the clip in its upper part (1280x1024).
struct Window {
    double scale;  // pixels of the mode by pixels of the clip
    double top;    // first row of the mode, in rows of the scaled clip
    Window(const ClipHeader& clip, const OniVideoMode& mode)
        : scale(double(mode.resolutionX) / clip.width),
          top(std::max(0.0, (scale * clip.height - mode.resolutionY) / 2)) {}
    int column(const ClipHeader& clip, int u) const {
        return std::min(int((u + 0.5) / scale), int(clip.width) - 1);
    }
    int row(const ClipHeader& clip, int v) const {
        return std::min(int((v + top + 0.5) / scale), int(clip.height) - 1);
    }
};

inline bool sameSize(const ClipHeader& clip, const OniVideoMode& mode) {
    return mode.resolutionX == int(clip.width) && mode.resolutionY == int(clip.height);
}

inline void undistort(const Camera& c, double& x, double& y) {
    const double xd = x, yd = y;
    for (int i = 0; i < 20; i++) {
        const double r2 = x * x + y * y;
        const double radial = 1 + r2 * (c.k1 + r2 * (c.k2 + r2 * c.k3));
        x = (xd - 2 * c.p1 * x * y - c.p2 * (r2 + 2 * x * x)) / radial;
        y = (yd - c.p1 * (r2 + 2 * y * y) - 2 * c.p2 * x * y) / radial;
    }
}

// Depth as the colour camera sees it: each pixel is moved as a whole, the nearest wins.
inline std::vector<uint16_t> registered(const ClipHeader& h, const uint16_t* depth) {
    const int width = int(h.width), height = int(h.height);
    std::vector<uint16_t> out(size_t(width) * height, 0);
    const Camera &d = h.depth, &c = h.color;
    const double *R = h.rotation, *t = h.translation;
    for (int v = 0; v < height; v++)
        for (int u = 0; u < width; u++) {
            const double z = depth[size_t(v) * width + u];
            if (z == 0) continue;
            double x = (u - d.cx) / d.fx, y = (v - d.cy) / d.fy;
            undistort(d, x, y);
            x *= z;
            y *= z;
            const double X = R[0] * x + R[1] * y + R[2] * z + t[0];
            const double Y = R[3] * x + R[4] * y + R[5] * z + t[1];
            const double Z = R[6] * x + R[7] * y + R[8] * z + t[2];
            if (Z < 1) continue;
            const double a = X / Z, b = Y / Z, r2 = a * a + b * b;
            const double radial = 1 + r2 * (c.k1 + r2 * (c.k2 + r2 * c.k3));
            const double xd = a * radial + 2 * c.p1 * a * b + c.p2 * (r2 + 2 * a * a);
            const double yd = b * radial + c.p1 * (r2 + 2 * b * b) + 2 * c.p2 * a * b;
            const int i = int(std::lround(c.fx * xd + c.cx)), j = int(std::lround(c.fy * yd + c.cy));
            if (i < 0 || j < 0 || i >= width || j >= height) continue;
            uint16_t& there = out[size_t(j) * width + i];
            const uint16_t mm = uint16_t(std::min(65535.0, Z + 0.5));
            if (there == 0 || mm < there) there = mm;
        }
    return out;
}

inline std::vector<uint16_t> scaledDepth(const ClipHeader& h, const uint16_t* depth,
                                         const OniVideoMode& mode) {
    const Window window(h, mode);
    const int unit = mode.pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM ? 10 : 1;
    const size_t size = size_t(mode.resolutionX) * mode.resolutionY;
    if (sameSize(h, mode) && unit == 1) return {depth, depth + size};
    std::vector<uint16_t> out(size);
    size_t at = 0;
    for (int v = 0; v < mode.resolutionY; v++) {
        const uint16_t* row = depth + size_t(window.row(h, v)) * h.width;
        for (int u = 0; u < mode.resolutionX; u++)
            out[at++] = uint16_t(std::min(row[window.column(h, u)] * unit, 65535));
    }
    return out;
}

// Each pixel the mean of those it covers, where the mode is smaller than the clip.
inline std::vector<uint8_t> scaledColor(const ClipHeader& h, const uint8_t* color,
                                        const OniVideoMode& mode) {
    const Window window(h, mode);
    const int covers = std::max(1, int(std::lround(1 / window.scale)));
    const size_t size = size_t(mode.resolutionX) * mode.resolutionY * 3;
    if (sameSize(h, mode)) return {color, color + size};
    std::vector<uint8_t> out(size);
    size_t at = 0;
    for (int v = 0; v < mode.resolutionY; v++)
        for (int u = 0; u < mode.resolutionX; u++)
            for (int channel = 0; channel < 3; channel++) {
                int sum = 0;
                for (int j = 0; j < covers; j++)
                    for (int i = 0; i < covers; i++) {
                        const int row = std::min(window.row(h, v) - covers / 2 + j, int(h.height) - 1);
                        const int column =
                            std::min(window.column(h, u) - covers / 2 + i, int(h.width) - 1);
                        sum += color[(size_t(row) * h.width + column) * 3 + channel];
                    }
                out[at++] = uint8_t((sum + covers * covers / 2) / (covers * covers));
            }
    return out;
}

// Freenect's is off by one: it shows each pixel one column too far to the right, and in the first
// column the first pixel of the next row.
inline void mirror(char* image, int width, int height, int pixel, bool freenect) {
    for (int row = 0; row < height; row++) {
        char* start = image + size_t(row) * width * pixel;
        for (int a = 0, b = width - 1; a < b; a++, b--)
            std::swap_ranges(start + a * pixel, start + (a + 1) * pixel, start + b * pixel);
        if (!freenect) continue;
        std::memmove(start + pixel, start, size_t(width - 1) * pixel);
        if (row + 1 < height) std::memcpy(start, start + size_t(width) * pixel, size_t(pixel));
    }
}

inline uint8_t clamped(double value) { return uint8_t(std::min(255.0, std::max(0.0, value + 0.5))); }

// BT.601 with 16 to 235, two pixels sharing their colour: U Y V Y, or Y U Y V.
inline std::vector<char> yuv(const std::vector<char>& rgb, bool lumaFirst) {
    std::vector<char> out(rgb.size() / 3 * 2);
    for (size_t pair = 0; pair < out.size() / 4; pair++) {
        const uint8_t* p = reinterpret_cast<const uint8_t*>(&rgb[pair * 6]);
        double y[2], u = 0, v = 0;
        for (int i = 0; i < 2; i++, p += 3) {
            y[i] = 16 + (65.481 * p[0] + 128.553 * p[1] + 24.966 * p[2]) / 255;
            u += (128 + (-37.797 * p[0] - 74.203 * p[1] + 112.0 * p[2]) / 255) / 2;
            v += (128 + (112.0 * p[0] - 93.786 * p[1] - 18.214 * p[2]) / 255) / 2;
        }
        uint8_t* to = reinterpret_cast<uint8_t*>(&out[pair * 4]);
        const int luma = lumaFirst ? 0 : 1, chroma = 1 - luma;
        to[luma] = clamped(y[0]);
        to[luma + 2] = clamped(y[1]);
        to[chroma] = clamped(u);
        to[chroma + 2] = clamped(v);
    }
    return out;
}

// A frame's number and the time of its exposure as blocks in the first rows: marks.py reads them.
constexpr int kMarkBits = 64, kMarkColumns = 80;
constexpr uint64_t kMarkGuard = 0xA5C3;
constexpr uint16_t kMarkMm[2] = {2000, 4000};

template <class Pixel, class Paint>
void mark(Pixel* image, int width, int channels, uint64_t number, uint64_t exposedNs,
          Paint paint) {
    const int block = std::max(1, width / kMarkColumns);
    const uint64_t words[2] = {exposedNs, number};
    for (int row = 0; row < 2 * block; row++)
        for (int column = 0; column < kMarkColumns * block; column++) {
            const uint64_t word = words[row / block];
            const uint64_t guard = kMarkGuard ^ word ^ word >> 16 ^ word >> 32 ^ word >> 48;
            const int at = column / block;
            const bool bit = at < kMarkBits ? word >> at & 1 : guard >> (at - kMarkBits) & 1;
            for (int channel = 0; channel < channels; channel++)
                image[(size_t(row) * width + column) * channels + channel] = paint(bit);
        }
}
