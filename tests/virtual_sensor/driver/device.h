// One device: its streams, and the clock that exposes and delivers their frames.
#pragma once
#include <csignal>
#include <deque>
#include <functional>

#include "factory.h"
#include "stream.h"

constexpr int64_t kFirstStampUs = 1000000;

// A frame that was exposed and is on its way.
struct Exposed {
    Stream* stream;
    int64_t number, stampUs, exposedNs, dueNs;
};

class Device : public DeviceBase {
public:
    Device(Control& control, std::function<void()> unplug)
        : session(control.device.plugs), shared_(control), unplug_(std::move(unplug)) {
        ok = shared_.clip.load(control.device.clip);
        shared_.registered = control.device.registered_at_start != 0;
        says_registered_ = shared_.registered.load();
        if (ok) clock_ = std::thread(&Device::play, this);
    }
    ~Device() override {
        {
            std::lock_guard<std::mutex> lock(shared_.mutex);
            closing_ = true;
            shared_.changed.notify_all();
        }
        if (clock_.joinable()) clock_.join();
    }
    bool ok = false;
    const int64_t session;  // a device that was replugged has to be opened anew

    Control& control() const { return shared_.control; }
    OniStatus getSensorInfoList(OniSensorInfo** sensors, int* count) override {
        // The library keeps the pointers that it was given.
        for (bool depth : {true, false}) {
            if (listed_ || !(depth ? control().depth : control().color).present) continue;
            modes_[depth] = Stream::offered(shared_, depth);
            infos_.push_back({depth ? ONI_SENSOR_DEPTH : ONI_SENSOR_COLOR, int(modes_[depth].size()),
                              modes_[depth].data()});
        }
        listed_ = true;
        *sensors = infos_.data();
        *count = int(infos_.size());
        return ONI_STATUS_OK;
    }
    StreamBase* createStream(OniSensorType type) override {
        mayHang(control(), Call::CREATE_STREAM);
        if (control().device.refuse & Call::CREATE_STREAM) return nullptr;
        std::lock_guard<std::mutex> lock(shared_.mutex);
        streams_.push_back(new Stream(shared_, type == ONI_SENSOR_DEPTH));
        return streams_.back();
    }
    void destroyStream(StreamBase* stream) override {
        mayHang(control(), Call::DESTROY_STREAM);
        std::unique_lock<std::mutex> lock(shared_.mutex);
        shared_.changed.wait(lock, [&] { return !sending_; });
        streams_.erase(std::remove(streams_.begin(), streams_.end(), stream), streams_.end());
        under_way_.erase(std::remove_if(under_way_.begin(), under_way_.end(),
                                        [&](const Exposed& one) { return one.stream == stream; }),
                         under_way_.end());
        delete static_cast<Stream*>(stream);
    }
    OniStatus getProperty(int id, void* data, int* size) override;
    OniStatus setProperty(int id, const void* data, int size) override;
    OniBool isPropertySupported(int id) override {
        if (id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION && control().device.driver == Driver::FREENECT)
            return true;
        char any[256];
        int size = sizeof any;
        return getProperty(id, any, &size) == ONI_STATUS_OK;
    }
    OniBool isImageRegistrationModeSupported(OniImageRegistrationMode mode) override {
        needsDepthStream();
        return mode == ONI_IMAGE_REGISTRATION_OFF || control().device.registration != Honesty::MISSING;
    }

private:
    Shared shared_;
    const std::function<void()> unplug_;
    bool closing_ = false;
    bool sending_ = false;
    std::atomic<bool> says_registered_{false};
    std::vector<Stream*> streams_;
    bool listed_ = false;
    std::vector<OniSensorInfo> infos_;
    std::vector<OniVideoMode> modes_[2];
    std::deque<Exposed> under_way_;
    int64_t origin_ns_ = 0;  // when number 0 was exposed
    std::thread clock_;

    // Freenect's driver asks its depth stream, and crashes where there is none.
    void needsDepthStream() {
        std::lock_guard<std::mutex> lock(shared_.mutex);
        const bool has = std::any_of(streams_.begin(), streams_.end(), [](const Stream* s) { return s->depth; });
        if (control().device.driver == Driver::FREENECT && !has) std::raise(SIGSEGV);
    }
    bool allRunning() const {
        return !streams_.empty() && std::all_of(streams_.begin(), streams_.end(),
                                                [](const Stream* s) -> bool { return s->running; });
    }
    bool noneRuns() const {
        return std::none_of(streams_.begin(), streams_.end(), [](const Stream* s) -> bool { return s->running; });
    }
    int64_t periodNs(const Stream& stream) const {
        return std::max<int64_t>(1000, int64_t(double(stream.periodUs()) * 1000 / control().device.speed));
    }
    int64_t exposureNs(const Stream& stream) const {
        const int64_t delayUs = control().device.synchronized ? 0 : stream.words().delay_us.load();
        return origin_ns_ + stream.next * periodNs(stream) + delayUs * 1000;
    }
    int64_t stampUs(const Stream& stream, int64_t exposedNs) const;
    void play();
    void begin();
    void join(Stream& stream);
    void expose(Stream& stream, int64_t now);
    void deliver(std::unique_lock<std::mutex>& lock);
};

inline OniStatus Device::getProperty(int id, void* data, int* size) {
    mayHang(control(), Call::GET_PROPERTY);
    const DeviceControl& words = control().device;
    if (words.refuse & Call::GET_PROPERTY) return ONI_STATUS_ERROR;
    if (id == ONI_DEVICE_PROPERTY_SERIAL_NUMBER && *words.serial && words.driver != Driver::FREENECT
            && words.driver != Driver::BARE) {
        const int length = int(std::strlen(words.serial)) + 1;
        if (*size < length) return ONI_STATUS_BAD_PARAMETER;
        std::memcpy(data, words.serial, size_t(length));
        *size = length;
        return ONI_STATUS_OK;
    }
    if (id == kFactoryCalibration && words.driver == Driver::ORBBEC)
        return put(factoryCalibration(shared_.clip.head, words.factory_blank), data, size);
    if (id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION && words.registration != Honesty::MISSING) {
        needsDepthStream();
        const bool says = says_registered_ && words.registration != Honesty::SECRET;
        return put(says ? ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR : ONI_IMAGE_REGISTRATION_OFF, data, size);
    }
    return ONI_STATUS_NOT_SUPPORTED;
}

inline OniStatus Device::setProperty(int id, const void* data, int size) {
    mayHang(control(), Call::SET_PROPERTY);
    const DeviceControl& words = control().device;
    if (words.refuse & Call::SET_PROPERTY) return ONI_STATUS_ERROR;
    if (id != ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION || size != sizeof(OniImageRegistrationMode)
            || words.registration == Honesty::MISSING || words.registration == Honesty::REFUSED)
        return ONI_STATUS_NOT_SUPPORTED;
    needsDepthStream();
    OniImageRegistrationMode mode;
    std::memcpy(&mode, data, sizeof mode);
    says_registered_ = mode == ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR;
    if (words.registration == Honesty::HONEST || words.registration == Honesty::SECRET)
        shared_.registered = says_registered_.load();
    return ONI_STATUS_OK;
}

inline int64_t Device::stampUs(const Stream& stream, int64_t exposedNs) const {
    const StreamControl& words = stream.words();
    // At the nominal speed a whole number of periods; the clock itself runs at the host's pace.
    const int64_t delayUs = control().device.synchronized ? 0 : words.delay_us.load();
    const double elapsedUs = control().device.speed == 1.0
        ? double(stream.next * stream.periodUs() + delayUs)
        : double(exposedNs - origin_ns_) / 1000;
    const int64_t ownUs = kFirstStampUs + std::llround(elapsedUs * (1 + words.drift_ppm * 1e-6));
    const int64_t epochUs = std::chrono::duration_cast<std::chrono::microseconds>(
        std::chrono::system_clock::now().time_since_epoch()).count() - (nowNs() - exposedNs) / 1000;
    int64_t stamp = ownUs;
    if (words.stamps == Stamps::NONE) return 0;
    if (words.stamps == Stamps::MILLISECONDS) stamp = ownUs / 1000;
    if (words.stamps == Stamps::EPOCH) stamp = epochUs;
    return stamp + words.stamp_offset_us;
}

// The first frame reaches all streams: the clock waits until every stream that was created runs.
inline void Device::begin() {
    const int64_t now = nowNs();
    int64_t number = 0;
    for (Stream* stream : streams_) number = std::max(number, stream->next);
    const int64_t period = periodNs(*streams_[0]);
    if (!origin_ns_ || !control().device.skips)
        origin_ns_ = now + period - number * period;
    // The sensor takes its time, as real ones do; on the grid that it is on.
    const int64_t wait = control().device.first_frame_us * 1000;
    for (Stream* stream : streams_) stream->next = std::max(
        stream->next, (now + period + wait - origin_ns_) / periodNs(*stream));
}

// A stream that starts takes its place on the grid: its next exposure is to come.
inline void Device::join(Stream& stream) {
    const int64_t period = periodNs(stream), elapsed = nowNs() - origin_ns_;
    if (elapsed > 0) stream.next = std::max(stream.next, (elapsed + period - 1) / period);
    stream.joined = true;
}

inline void Device::expose(Stream& stream, int64_t now) {
    const DeviceControl& words = control().device;
    const int64_t exposed = exposureNs(stream), number = stream.next;
    StreamControl& own = stream.words();
    uint32_t hash = uint32_t(number + 1) * 2654435761u;
    hash ^= hash >> 15;
    const bool lost = take(own.drop_next) || int64_t(hash % 1000) < own.drop_per_mille;
    if (lost) own.lost++;
    const int64_t jitter = words.jitter_us > 0 ? int64_t(hash >> 8) % (words.jitter_us * 1000) : 0;
    const int64_t due = exposed + words.pipeline_us * 1000 + jitter;
    if (!lost && !own.silent && stream.running)
        under_way_.push_back({&stream, number, stampUs(stream, exposed), exposed, due});
    stream.next++;
    const int64_t late = now - exposureNs(stream);
    if (late <= 0) return;
    if (words.skips) {
        const int64_t missed = late / periodNs(stream);
        stream.next += missed;
        own.lost += missed;
    } else {
        origin_ns_ += late;
    }
}

// Gives what is due to the library.
inline void Device::deliver(std::unique_lock<std::mutex>& lock) {
    std::vector<Exposed> due;
    const int64_t now = nowNs();
    for (auto one = under_way_.begin(); one != under_way_.end();)
        if (one->dueNs <= now) {
            due.push_back(*one);
            one = under_way_.erase(one);
        } else {
            ++one;
        }
    if (due.empty()) return;
    // OpenNI2 takes locks of its own when a frame is raised: not under ours.
    sending_ = true;
    lock.unlock();
    for (const Exposed& one : due) {
        if (!one.stream->running) continue;
        const bool arrival = one.stream->words().stamps == Stamps::ARRIVAL;
        const int64_t lateUs = arrival ? (nowNs() - one.exposedNs) / 1000 : 0;
        one.stream->send(one.number, one.stampUs + lateUs, one.exposedNs);
    }
    lock.lock();
    sending_ = false;
    shared_.changed.notify_all();
}

inline void Device::play() {
    nameThread();
    const DeviceControl& words = control().device;
    const auto there = [&] { return words.plugged && words.plugs == session; };
    std::unique_lock<std::mutex> lock(shared_.mutex);
    bool begun = false;
    while (!closing_) {
        if (!begun) {
            shared_.changed.wait(lock, [&] { return closing_ || allRunning(); });
            if (closing_) return;
            begin();
            begun = true;
        }
        for (Stream* stream : streams_)
            if (stream->running && !stream->joined) join(*stream);
        int64_t next = INT64_MAX;
        for (Stream* stream : streams_)
            if (stream->running) next = std::min(next, exposureNs(*stream));
        for (const Exposed& one : under_way_) next = std::min(next, one.dueNs);
        if (next == INT64_MAX || noneRuns()) {
            under_way_.clear();
            begun = false;
            continue;
        }
        const auto until = std::chrono::steady_clock::time_point(std::chrono::nanoseconds(next));
        shared_.changed.wait_until(lock, until, [&] { return closing_ || noneRuns(); });
        if (closing_) return;
        if (noneRuns()) continue;
        if (!there()) {
            under_way_.clear();
            // Gone: nothing comes any more, until it is closed.
            shared_.changed.wait(lock, [&] { return closing_; });
            return;
        }
        const int64_t now = nowNs();
        for (Stream* stream : streams_) {
            if (!stream->running || exposureNs(*stream) > now) continue;
            if (words.unplug_after >= 0 && stream->next >= words.unplug_after) {
                lock.unlock();
                unplug_();
                return;
            }
            if (!words.loop && stream->next >= int64_t(shared_.clip.head.frames)) {
                stream->next++;
                continue;
            }
            expose(*stream, now);
        }
        deliver(lock);
    }
}
