// Orbbec's factory calibration: a device property of its OpenNI2 driver (OBEXTENSION_ID_CAM_PARAMS).
#pragma once
#include <cmath>

#include "clip.h"

constexpr int kFactoryCalibration = 14;
constexpr int kNotMirrored = 2;

// "Left" is the depth camera, "right" the colour camera; for all its name the pose takes points from
// the depth camera's frame to the colour's, in mm.
struct FactoryCalibration {
    float depth[4], color[4];  // fx, fy, cx, cy at 640x480
    float rotation[9], translation[3];
    float depthDistortion[5], colorDistortion[5];  // k1, k2, k3, p1, p2
    int mirrored;
};
static_assert(sizeof(FactoryCalibration) == 124);

inline FactoryCalibration factoryCalibration(const ClipHeader& clip, bool blank) {
    FactoryCalibration out{};
    const auto fill = [&](const Camera& camera, float* pinhole, float* distortion) {
        const double scale = 640.0 / clip.width;
        const double values[] = {camera.fx * scale, camera.fy * scale, (camera.cx + 0.5) * scale - 0.5,
                                 (camera.cy + 0.5) * scale - 0.5};
        const double orders[] = {camera.k1, camera.k2, camera.k3, camera.p1, camera.p2};
        for (int i = 0; i < 4; i++) pinhole[i] = blank ? NAN : float(values[i]);
        for (int i = 0; i < 5; i++) distortion[i] = blank ? NAN : float(orders[i]);
    };
    fill(clip.depth, out.depth, out.depthDistortion);
    fill(clip.color, out.color, out.colorDistortion);
    for (int i = 0; i < 9; i++) out.rotation[i] = blank ? NAN : float(clip.rotation[i]);
    for (int i = 0; i < 3; i++) out.translation[i] = blank ? NAN : float(clip.translation[i]);
    out.mirrored = kNotMirrored;
    return out;
}
