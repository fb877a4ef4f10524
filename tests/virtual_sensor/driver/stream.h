// One stream of a device: what it says of itself, and how a frame of it is made.
#pragma once
#include <condition_variable>
#include <map>
#include <mutex>

#define XN_NEW(type, arg) new type(arg)
#define XN_DELETE(p) delete (p)
#include "Driver/OniDriverAPI.h"
#include "PS1080.h"
#include "exposure.h"
#include "image.h"
#include "steering.h"

using namespace oni::driver;

constexpr int64_t kClipPeriodUs = 33333;

// What both streams of a device share.
struct Shared {
    Control& control;
    Clip clip;
    std::mutex mutex;
    std::condition_variable changed;
    std::atomic<bool> registered{false};
    explicit Shared(Control& c) : control(c) {}
};

template <class T> OniStatus put(const T& value, void* data, int* size) {
    if (*size < int(sizeof value)) return ONI_STATUS_BAD_PARAMETER;
    std::memcpy(data, &value, sizeof value);
    *size = sizeof value;
    return ONI_STATUS_OK;
}

inline bool isCameraProperty(int id) {
    return id == ONI_STREAM_PROPERTY_AUTO_EXPOSURE || id == ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE
        || id == ONI_STREAM_PROPERTY_EXPOSURE;
}

class Stream : public StreamBase {
public:
    const bool depth;
    std::atomic<bool> running{false};
    bool joined = false;  // on the grid since its last start
    int64_t next = 0;  // number of the next exposure, on the grid of this stream's rate

    Stream(Shared& shared, bool isDepth)
        : depth(isDepth), shared_(shared), words_(isDepth ? shared.control.depth : shared.control.color),
          modes_(offered(shared, isDepth)), mode_(modes_[0]),
          mirrored_(words_.mirrored_at_start != 0), says_mirrored_(words_.mirrored_at_start != 0),
          crop_{words_.crop_width != 0, int(words_.crop_left), int(words_.crop_top),
                int(words_.crop_width), int(words_.crop_height)}, says_crop_(crop_) {
        words_.created++;
    }
    ~Stream() override { words_.destroyed++; }

    static std::vector<OniVideoMode> offered(const Shared& shared, bool depth) {
        const StreamControl& words = depth ? shared.control.depth : shared.control.color;
        return parseModes(words.modes, {depth ? ONI_PIXEL_FORMAT_DEPTH_1_MM : ONI_PIXEL_FORMAT_RGB888,
                                        int(shared.clip.head.width), int(shared.clip.head.height), 30});
    }
    int64_t periodUs() const { return 1000000 / std::max(1, mode_.fps); }
    StreamControl& words() const { return words_; }

    OniStatus start() override {
        mayHang(shared_.control, Call::START);
        if (shared_.control.device.refuse & Call::START) return ONI_STATUS_ERROR;
        return run(true);
    }
    void stop() override {
        mayHang(shared_.control, Call::STOP);
        run(false);
    }
    OniStatus getProperty(int id, void* data, int* size) override;
    OniStatus setProperty(int id, const void* data, int size) override;
    OniBool isPropertySupported(int id) override {
        char any[64];
        int size = sizeof any;
        return getProperty(id, any, &size) == ONI_STATUS_OK;
    }
    void notifyAllProperties() override;
    void send(int64_t number, int64_t stampUs, int64_t exposedNs);

private:
    Shared& shared_;
    StreamControl& words_;
    const std::vector<OniVideoMode> modes_;
    OniVideoMode mode_;
    std::atomic<OniBool> mirrored_, says_mirrored_;
    OniCropping crop_, says_crop_;
    Exposure exposure_;
    std::vector<char> last_;  // what was sent last: shown again while frozen
    int64_t lastStampUs_ = 0;
    int index_ = 0;  // counts what is sent, as real drivers do: a frame that is lost leaves no gap
    std::map<size_t, std::vector<char>> kept_;
    OniVideoMode kept_mode_{};
    bool kept_registered_ = false;

    OniStatus run(bool on) {
        std::lock_guard<std::mutex> lock(shared_.mutex);
        running = on;
        words_.running = on;
        if (on) {
            joined = false;
            exposure_.restart();
        }
        shared_.changed.notify_all();
        return ONI_STATUS_OK;
    }
    void scene(size_t index);
    void picture(int64_t number, int64_t exposedNs);
    void cut(OniFrame& frame, const std::vector<char>& image) const;
    OniStatus answerOfDepth(int id, void* data, int* size);
    OniStatus answerOfCamera(int id, void* data, int* size);
    OniStatus setCamera(int id, const void* data, int size);
    bool hasCamera(int id) const {
        return !depth && shared_.control.device.camera_controls && isCameraProperty(id);
    }
};

inline OniStatus Stream::answerOfDepth(int id, void* data, int* size) {
    const ClipHeader& h = shared_.clip.head;
    const bool freenect = shared_.control.device.driver == Driver::FREENECT;
    switch (id) {
    case ONI_STREAM_PROPERTY_MAX_VALUE:
        return put(mode_.pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM ? 65535 : 10000, data, size);
    case XN_STREAM_PROPERTY_ZERO_PLANE_DISTANCE: return put(freenect ? uint64_t(120) : h.zpd, data, size);
    case XN_STREAM_PROPERTY_ZERO_PLANE_PIXEL_SIZE: return put(freenect ? 0.1052 : h.zpps, data, size);
    }
    if (id == XN_STREAM_PROPERTY_EMITTER_DCMOS_DISTANCE) return put(freenect ? 7.5 : h.lddis, data, size);
    if (id == XN_STREAM_PROPERTY_DCMOS_RCMOS_DISTANCE && !freenect) return put(h.dcrcdis, data, size);
    return ONI_STATUS_NOT_SUPPORTED;
}

inline OniStatus Stream::answerOfCamera(int id, void* data, int* size) {
    switch (id) {
    case ONI_STREAM_PROPERTY_AUTO_EXPOSURE: return put(OniBool(exposure_.exposes), data, size);
    case ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE: return put(OniBool(exposure_.balances), data, size);
    case ONI_STREAM_PROPERTY_EXPOSURE:
        return put(exposure_.value(shared_.control.device.breathing_per_mille), data, size);
    }
    return ONI_STATUS_NOT_SUPPORTED;
}

// PS1080 takes these only while it streams; Freenect confuses the two switches.
inline OniStatus Stream::setCamera(int id, const void* data, int size) {
    if (size != sizeof(int)) return ONI_STATUS_BAD_PARAMETER;
    if (!running) return ONI_STATUS_ERROR;
    int value;
    std::memcpy(&value, data, sizeof value);
    const bool freenect = shared_.control.device.driver == Driver::FREENECT;
    if (id == ONI_STREAM_PROPERTY_AUTO_EXPOSURE && !freenect) {
        exposure_.exposes = value != 0;
    } else if (id == ONI_STREAM_PROPERTY_EXPOSURE) {
        if (exposure_.exposes || value < 1) return ONI_STATUS_ERROR;
        exposure_.set(value);
    } else {
        exposure_.balances = value != 0;
    }
    return ONI_STATUS_OK;
}


inline OniStatus Stream::getProperty(int id, void* data, int* size) {
    mayHang(shared_.control, Call::GET_PROPERTY);
    if (shared_.control.device.refuse & Call::GET_PROPERTY) return ONI_STATUS_ERROR;
    const int64_t driver = shared_.control.device.driver;
    const ClipHeader& h = shared_.clip.head;
    const float freenectFov[2] = {float(62.0 * M_PI / 180), float(48.6 * M_PI / 180)};
    const float* fov = depth ? h.depthFov : driver == Driver::FREENECT ? freenectFov : h.colorFov;
    if (id == ONI_STREAM_PROPERTY_VIDEO_MODE) return put(mode_, data, size);
    if (id == ONI_STREAM_PROPERTY_MIRRORING && words_.mirroring != Honesty::MISSING)
        return put(words_.mirroring == Honesty::SECRET ? OniBool(FALSE) : says_mirrored_.load(), data, size);
    if (id == ONI_STREAM_PROPERTY_CROPPING && words_.cropping != Honesty::MISSING)
        return put(words_.cropping == Honesty::SECRET ? OniCropping{} : says_crop_, data, size);
    if (hasCamera(id)) return answerOfCamera(id, data, size);
    if (driver == Driver::BARE) return ONI_STATUS_NOT_SUPPORTED;
    switch (id) {
    case ONI_STREAM_PROPERTY_HORIZONTAL_FOV: return put(fov[0], data, size);
    case ONI_STREAM_PROPERTY_VERTICAL_FOV: return put(fov[1], data, size);
    }
    return depth ? answerOfDepth(id, data, size) : OniStatus(ONI_STATUS_NOT_SUPPORTED);
}

inline OniStatus Stream::setProperty(int id, const void* data, int size) {
    mayHang(shared_.control, Call::SET_PROPERTY);
    if (shared_.control.device.refuse & Call::SET_PROPERTY) return ONI_STATUS_ERROR;
    const auto acts = [](int64_t honesty) { return honesty == Honesty::HONEST || honesty == Honesty::SECRET; };
    const auto refuses = [](int64_t honesty) { return honesty == Honesty::MISSING || honesty == Honesty::REFUSED; };
    if (id == ONI_STREAM_PROPERTY_MIRRORING && size == sizeof(OniBool) && !refuses(words_.mirroring)) {
        says_mirrored_ = *static_cast<const OniBool*>(data);
        if (acts(words_.mirroring)) mirrored_ = says_mirrored_.load();
        raisePropertyChanged(id, data, size);
        return ONI_STATUS_OK;
    }
    if (id == ONI_STREAM_PROPERTY_CROPPING && size == sizeof(OniCropping) && !refuses(words_.cropping)) {
        OniCropping wanted;
        std::memcpy(&wanted, data, sizeof wanted);
        if (wanted.enabled && (wanted.originX < 0 || wanted.originY < 0 || wanted.width < 1 || wanted.height < 1
                || wanted.originX + wanted.width > mode_.resolutionX
                || wanted.originY + wanted.height > mode_.resolutionY)) return ONI_STATUS_BAD_PARAMETER;
        std::lock_guard<std::mutex> lock(shared_.mutex);
        says_crop_ = wanted;
        if (acts(words_.cropping)) crop_ = wanted;
        return ONI_STATUS_OK;
    }
    if (id == ONI_STREAM_PROPERTY_VIDEO_MODE && size == sizeof(OniVideoMode)) {
        for (const OniVideoMode& one : modes_)
            if (!std::memcmp(data, &one, sizeof one)) {
                if (running && std::memcmp(&mode_, &one, sizeof one)) return ONI_STATUS_OUT_OF_FLOW;
                std::lock_guard<std::mutex> lock(shared_.mutex);
                mode_ = one;
                return ONI_STATUS_OK;
            }
    }
    return hasCamera(id) ? setCamera(id, data, size) : OniStatus(ONI_STATUS_NOT_SUPPORTED);
}

// What is raised here, OpenNI2's recorder stores. Without CROPPING its player drops each frame.
inline void Stream::notifyAllProperties() {
    for (int id : {int(ONI_STREAM_PROPERTY_VIDEO_MODE), int(ONI_STREAM_PROPERTY_HORIZONTAL_FOV),
                   int(ONI_STREAM_PROPERTY_VERTICAL_FOV), int(ONI_STREAM_PROPERTY_MIRRORING),
                   int(ONI_STREAM_PROPERTY_CROPPING), int(ONI_STREAM_PROPERTY_MAX_VALUE),
                   int(XN_STREAM_PROPERTY_ZERO_PLANE_DISTANCE),
                   int(XN_STREAM_PROPERTY_ZERO_PLANE_PIXEL_SIZE),
                   int(XN_STREAM_PROPERTY_EMITTER_DCMOS_DISTANCE),
                   int(XN_STREAM_PROPERTY_DCMOS_RCMOS_DISTANCE)}) {
        char value[64];
        int size = sizeof value;
        if (getProperty(id, value, &size) == ONI_STATUS_OK) raisePropertyChanged(id, value, size);
    }
}

// What the camera sees, into `last_`. Registration and scaling take milliseconds: their results are
// kept, one for each frame of the clip.
inline void Stream::scene(size_t index) {
    const Clip& clip = shared_.clip;
    const bool moved = depth && shared_.registered;
    if (!moved && sameSize(clip.head, mode_) && mode_.pixelFormat != ONI_PIXEL_FORMAT_DEPTH_100_UM) {
        kept_.clear();
        const char* image = depth ? reinterpret_cast<const char*>(clip.depth(index))
                                  : reinterpret_cast<const char*>(clip.color(index));
        last_.assign(image, image + (depth ? clip.depthSize() : clip.colorSize()));
        return;
    }
    if (moved != kept_registered_ || std::memcmp(&kept_mode_, &mode_, sizeof mode_)) kept_.clear();
    kept_registered_ = moved;
    kept_mode_ = mode_;
    std::vector<char>& kept = kept_[index];
    if (!kept.empty()) {
        last_ = kept;
        return;
    }
    if (depth) {
        std::vector<uint16_t> image(clip.depth(index), clip.depth(index) + clip.depthSize() / 2);
        if (moved) image = registered(clip.head, image.data());
        image = scaledDepth(clip.head, image.data(), mode_);
        const char* bytes = reinterpret_cast<const char*>(image.data());
        kept.assign(bytes, bytes + image.size() * 2);
    } else {
        const std::vector<uint8_t> image = scaledColor(clip.head, clip.color(index), mode_);
        kept.assign(image.begin(), image.end());
    }
    last_ = kept;
}

inline void Stream::picture(int64_t number, int64_t exposedNs) {
    const int width = mode_.resolutionX, height = mode_.resolutionY;
    // The clip is 30 frames a second, whatever the stream's rate.
    const DeviceControl& words = shared_.control.device;
    scene(size_t(number * periodUs() / kClipPeriodUs) % shared_.clip.head.frames);
    if (!depth) {
        exposure_.light(last_, words.breathing_per_mille);
        exposure_.step(words.settle_frames);
    }
    if (words.marks) {
        const uint64_t counter = uint64_t(number), when = uint64_t(exposedNs);
        const int unit = mode_.pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM ? 10 : 1;
        if (depth)
            mark(reinterpret_cast<uint16_t*>(last_.data()), width, 1, counter, when,
                 [&](bool bit) { return uint16_t(kMarkMm[bit] * unit); });
        else
            mark(reinterpret_cast<uint8_t*>(last_.data()), width, 3, counter, when,
                 [](bool bit) { return uint8_t(bit ? 255 : 0); });
    }
    if (mirrored_) mirror(last_.data(), width, height, depth ? 2 : 3, words.driver == Driver::FREENECT);
    if (!depth && mode_.pixelFormat != ONI_PIXEL_FORMAT_RGB888)
        last_ = yuv(last_, mode_.pixelFormat == ONI_PIXEL_FORMAT_YUYV);
}

// Cropping: the frame has the rows and columns of the window only.
inline void Stream::cut(OniFrame& frame, const std::vector<char>& image) const {
    const int pixel = bytesPerPixel(mode_.pixelFormat);
    const bool crops = crop_.enabled;
    const int left = crops ? crop_.originX : 0, top = crops ? crop_.originY : 0;
    frame.width = crops ? crop_.width : mode_.resolutionX;
    frame.height = crops ? crop_.height : mode_.resolutionY;
    frame.stride = frame.width * pixel;
    frame.dataSize = frame.stride * frame.height;
    const bool says = crops && words_.cropping != Honesty::SECRET;
    frame.croppingEnabled = says;
    frame.cropOriginX = says ? left : 0;
    frame.cropOriginY = says ? top : 0;
    for (int row = 0; row < frame.height; row++)
        std::memcpy(static_cast<char*>(frame.data) + size_t(row) * frame.stride,
                    image.data() + (size_t(row + top) * mode_.resolutionX + left) * pixel, size_t(frame.stride));
}

inline void Stream::send(int64_t number, int64_t stampUs, int64_t exposedNs) {
    const bool frozen = words_.frozen && !last_.empty();
    if (!frozen) picture(number, exposedNs);
    if (!frozen || !words_.frozen_stamps) {
        lastStampUs_ = stampUs;
        index_++;
    }
    OniFrame* frame = getServices().acquireFrame();
    if (!frame) return;
    frame->videoMode = mode_;
    frame->sensorType = depth ? ONI_SENSOR_DEPTH : ONI_SENSOR_COLOR;
    frame->frameIndex = index_;
    frame->timestamp = uint64_t(lastStampUs_);
    cut(*frame, last_);
    if (take(words_.garbled_next)) {
        uint32_t noise = uint32_t(number) * 2654435761u + 1;
        for (int i = 0; i < frame->dataSize; i++) {
            noise = noise * 1664525u + 1013904223u;
            static_cast<char*>(frame->data)[i] = char(noise >> 24);
        }
    }
    if (take(words_.wrong_size_next)) {
        frame->height /= 2;
        frame->dataSize = frame->stride * frame->height;
    }
    raiseNewFrame(frame);
    getServices().releaseFrame(frame);
    words_.last_exposed_ns = exposedNs;
    words_.frames++;
}
