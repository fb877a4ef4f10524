// A virtual RGB-D sensor: an OpenNI2 driver that plays frames from a file as a live device,
// 640x480 at 30 frames a second, through the unmodified OpenNI2 library.
// The layout of that file: clip.py; the environment variables that steer the sensor: process.py.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#define XN_NEW(type, arg) new type(arg)
#define XN_DELETE(p) delete (p)
#include "Driver/OniDriverAPI.h"
#include "PS1080.h"

using namespace oni::driver;

static std::string env(const char* name, const char* otherwise = "") {
    const char* value = std::getenv((std::string("VIRTUAL_SENSOR_") + name).c_str());
    return value && *value ? value : otherwise;
}

struct Header {
    char magic[8];
    uint32_t version, frames, width, height;
    uint64_t zpd;
    double zpps, lddis, dcrcdis;
    float depthFov[2], colorFov[2];
};

struct Clip {
    Header head{};
    std::vector<char> bytes;
    size_t depthSize() const { return size_t(2) * head.width * head.height; }
    size_t colorSize() const { return size_t(3) * head.width * head.height; }
    bool load(const std::string& path) {
        std::ifstream file(path, std::ios::binary);
        if (!file.read(reinterpret_cast<char*>(&head), sizeof head)) return false;
        if (std::memcmp(head.magic, "VSENSOR1", 8) || head.version != 1 || !head.frames) return false;
        bytes.resize(head.frames * (depthSize() + colorSize()));
        return bool(file.read(bytes.data(), std::streamsize(bytes.size())));
    }
    const char* image(bool depth, size_t index) const {
        return bytes.data() + index * (depthSize() + colorSize()) + (depth ? 0 : depthSize());
    }
};

class Stream : public StreamBase {
public:
    const bool depth;
    std::atomic<bool> running{false};
    Stream(const Clip& clip, bool isDepth, std::mutex& mutex, std::condition_variable& changed)
        : depth(isDepth), clip_(clip), mutex_(mutex), changed_(changed) {}

    static OniVideoMode mode(const Clip& clip, bool depth) {
        const bool fine = env("DEPTH_UNIT") == "100um";
        return {depth ? (fine ? ONI_PIXEL_FORMAT_DEPTH_100_UM : ONI_PIXEL_FORMAT_DEPTH_1_MM)
                      : ONI_PIXEL_FORMAT_RGB888, int(clip.head.width), int(clip.head.height), 30};
    }
    OniStatus start() override { return run(true); }
    void stop() override { run(false); }

    OniStatus getProperty(int id, void* data, int* size) override {
        const Header& h = clip_.head;
        const float* fov = depth ? h.depthFov : h.colorFov;
        switch (id) {
        case ONI_STREAM_PROPERTY_VIDEO_MODE: return put(mode(clip_, depth), data, size);
        case ONI_STREAM_PROPERTY_HORIZONTAL_FOV: return put(fov[0], data, size);
        case ONI_STREAM_PROPERTY_VERTICAL_FOV: return put(fov[1], data, size);
        case ONI_STREAM_PROPERTY_MIRRORING: return put(mirrored_.load(), data, size);
        case ONI_STREAM_PROPERTY_CROPPING: return put(OniCropping{}, data, size);
        }
        if (depth) switch (id) {
        case ONI_STREAM_PROPERTY_MAX_VALUE: return put(int(10000), data, size);
        case XN_STREAM_PROPERTY_ZERO_PLANE_DISTANCE: return put(h.zpd, data, size);
        case XN_STREAM_PROPERTY_ZERO_PLANE_PIXEL_SIZE: return put(h.zpps, data, size);
        case XN_STREAM_PROPERTY_EMITTER_DCMOS_DISTANCE: return put(h.lddis, data, size);
        case XN_STREAM_PROPERTY_DCMOS_RCMOS_DISTANCE: return put(h.dcrcdis, data, size);
        }
        return ONI_STATUS_NOT_SUPPORTED;
    }
    OniBool isPropertySupported(int id) override {
        char any[64];
        int size = sizeof any;
        return getProperty(id, any, &size) == ONI_STATUS_OK;
    }
    OniStatus setProperty(int id, const void* data, int size) override {
        if (id == ONI_STREAM_PROPERTY_MIRRORING && size == sizeof(OniBool)) {
            mirrored_ = *static_cast<const OniBool*>(data);
            raisePropertyChanged(id, data, size);
            return ONI_STATUS_OK;
        }
        const OniVideoMode only = mode(clip_, depth);
        const bool same = id == ONI_STREAM_PROPERTY_VIDEO_MODE && size == sizeof only
            && !std::memcmp(data, &only, sizeof only);
        return same ? ONI_STATUS_OK : ONI_STATUS_NOT_SUPPORTED;
    }
    // What is raised here, OpenNI2's recorder stores. Without CROPPING its player drops each frame.
    void notifyAllProperties() override {
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
    void send(int number, uint64_t stampUs) {
        OniFrame* frame = getServices().acquireFrame();
        if (!frame) return;
        const size_t w = clip_.head.width, h = clip_.head.height, pixel = depth ? 2 : 3;
        const char* image = clip_.image(depth, size_t(number) % clip_.head.frames);
        char* out = static_cast<char*>(frame->data);
        std::memcpy(out, image, w * h * pixel);
        if (depth && env("DEPTH_UNIT") == "100um") {
            uint16_t* mm = reinterpret_cast<uint16_t*>(out);
            for (size_t i = 0; i < w * h; i++) mm[i] = uint16_t(std::min(mm[i] * 10, 65535));
        }
        if (mirrored_)
            for (size_t row = 0; row < h; row++)
                for (size_t a = 0, b = w - 1; a < b; a++, b--)
                    std::swap_ranges(out + (row * w + a) * pixel, out + (row * w + a + 1) * pixel,
                                     out + (row * w + b) * pixel);
        frame->videoMode = mode(clip_, depth);
        frame->sensorType = depth ? ONI_SENSOR_DEPTH : ONI_SENSOR_COLOR;
        frame->frameIndex = number + 1;
        frame->timestamp = stampUs;
        frame->width = int(w);
        frame->height = int(h);
        frame->stride = int(w * pixel);
        frame->dataSize = int(w * h * pixel);
        frame->croppingEnabled = FALSE;
        frame->cropOriginX = frame->cropOriginY = 0;
        raiseNewFrame(frame);
        getServices().releaseFrame(frame);
    }

private:
    const Clip& clip_;
    std::mutex& mutex_;
    std::condition_variable& changed_;
    std::atomic<OniBool> mirrored_{TRUE};  // as real sensors start

    template <class T> OniStatus put(const T& value, void* data, int* size) {
        if (*size < int(sizeof value)) return ONI_STATUS_BAD_PARAMETER;
        std::memcpy(data, &value, sizeof value);
        *size = sizeof value;
        return ONI_STATUS_OK;
    }
    OniStatus run(bool on) {
        std::lock_guard<std::mutex> lock(mutex_);
        running = on;
        changed_.notify_all();
        return ONI_STATUS_OK;
    }
};

class SensorDriver;

class Device : public DeviceBase {
public:
    Device(SensorDriver& driver, const std::string& path) : driver_(driver) {
        ok = clip_.load(path);
        if (ok) clock_ = std::thread(&Device::play, this);
    }
    ~Device() override {
        {
            std::lock_guard<std::mutex> lock(mutex_);
            closing_ = true;
            changed_.notify_all();
        }
        if (clock_.joinable()) clock_.join();
    }
    bool ok = false;

    OniStatus getSensorInfoList(OniSensorInfo** sensors, int* count) override {
        const std::string which = env("STREAMS", "both");
        infos_.clear();
        for (bool depth : {true, false}) {
            if (which == (depth ? "color" : "depth")) continue;
            modes_[depth] = Stream::mode(clip_, depth);
            infos_.push_back({depth ? ONI_SENSOR_DEPTH : ONI_SENSOR_COLOR, 1, &modes_[depth]});
        }
        *sensors = infos_.data();
        *count = int(infos_.size());
        return ONI_STATUS_OK;
    }
    StreamBase* createStream(OniSensorType type) override {
        std::lock_guard<std::mutex> lock(mutex_);
        streams_.push_back(new Stream(clip_, type == ONI_SENSOR_DEPTH, mutex_, changed_));
        return streams_.back();
    }
    void destroyStream(StreamBase* stream) override {
        std::unique_lock<std::mutex> lock(mutex_);
        changed_.wait(lock, [&] { return !sending_; });
        streams_.erase(std::remove(streams_.begin(), streams_.end(), stream), streams_.end());
        delete stream;
    }

private:
    SensorDriver& driver_;
    Clip clip_;
    std::mutex mutex_;
    std::condition_variable changed_;
    bool closing_ = false;
    bool sending_ = false;
    std::vector<Stream*> streams_;
    std::vector<OniSensorInfo> infos_;
    OniVideoMode modes_[2];
    std::thread clock_;

    bool allRunning() const {
        return !streams_.empty() && std::all_of(streams_.begin(), streams_.end(),
                                                [](const Stream* s) -> bool { return s->running; });
    }
    void play();
};

class SensorDriver : public DriverBase {
public:
    explicit SensorDriver(OniDriverServices* services) : DriverBase(services) {
        std::strcpy(info_.uri, "virtual:0");
        std::strcpy(info_.vendor, "denseface");
        std::strcpy(info_.name, "virtual sensor");
    }
    OniStatus initialize(DeviceConnectedCallback connected, DeviceDisconnectedCallback gone,
                         DeviceStateChangedCallback changed, void* cookie) override {
        DriverBase::initialize(connected, gone, changed, cookie);
        if (!env("FRAMES").empty()) deviceConnected(&info_);
        return ONI_STATUS_OK;
    }
    DeviceBase* deviceOpen(const char*, const char*) override {
        Device* device = new Device(*this, env("FRAMES"));
        if (device->ok) return device;
        getServices().errorLoggerAppend("%s is not a frame file of the virtual sensor",
                                        env("FRAMES").c_str());
        delete device;
        return nullptr;
    }
    void deviceClose(DeviceBase* device) override { delete device; }
    void shutdown() override {}
    void unplug() { deviceDisconnected(&info_); }

private:
    OniDeviceInfo info_{};
};

// The clock waits until every stream that was created runs, so the first frame reaches them all.
void Device::play() {
    const auto period = std::chrono::microseconds(33333);
    const bool loops = env("END", "loop") == "loop";
    const int unplugAfter = std::atoi(env("DISCONNECT_AFTER", "-1").c_str());
    const long skewUs = std::atol(env("SKEW_US", "0").c_str());
    auto next = std::chrono::steady_clock::now();
    std::unique_lock<std::mutex> lock(mutex_);
    for (int number = 0; !closing_; number++) {
        changed_.wait(lock, [&] { return closing_ || allRunning(); });
        next = std::max(next + period, std::chrono::steady_clock::now());
        if (changed_.wait_until(lock, next, [&] { return closing_; })) return;
        if (number == unplugAfter) {
            lock.unlock();
            driver_.unplug();
            return;
        }
        if (number >= int(clip_.head.frames) && !loops) return;
        const int64_t stampUs = 1000000 + number * int64_t(33333);
        // OpenNI2 takes locks of its own when a frame is raised: not under ours.
        const std::vector<Stream*> receivers = streams_;
        sending_ = true;
        lock.unlock();
        for (Stream* stream : receivers)
            if (stream->running) stream->send(number, uint64_t(stampUs + (stream->depth ? 0 : skewUs)));
        lock.lock();
        sending_ = false;
        changed_.notify_all();
    }
}

ONI_EXPORT_DRIVER(SensorDriver)
