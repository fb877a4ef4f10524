// Video modes as text: WIDTHxHEIGHT@FPS:FORMAT, separated by commas.
#pragma once
#include <cstdio>
#include <string>
#include <vector>

#include "OniCTypes.h"

inline OniPixelFormat pixelFormat(const std::string& name) {
    if (name == "1mm") return ONI_PIXEL_FORMAT_DEPTH_1_MM;
    if (name == "100um") return ONI_PIXEL_FORMAT_DEPTH_100_UM;
    if (name == "yuv422") return ONI_PIXEL_FORMAT_YUV422;
    if (name == "yuyv") return ONI_PIXEL_FORMAT_YUYV;
    return ONI_PIXEL_FORMAT_RGB888;
}

inline int bytesPerPixel(OniPixelFormat format) {
    return format == ONI_PIXEL_FORMAT_RGB888 ? 3 : 2;
}

inline std::vector<OniVideoMode> parseModes(const std::string& text, OniVideoMode otherwise) {
    std::vector<OniVideoMode> modes;
    for (size_t from = 0; from < text.size();) {
        const size_t to = std::min(text.find(',', from), text.size());
        OniVideoMode mode{};
        char name[16] = "";
        if (std::sscanf(text.substr(from, to - from).c_str(), "%dx%d@%d:%15s", &mode.resolutionX,
                        &mode.resolutionY, &mode.fps, name) == 4) {
            mode.pixelFormat = pixelFormat(name);
            modes.push_back(mode);
        }
        from = to + 1;
    }
    if (modes.empty()) modes.push_back(otherwise);
    return modes;
}
