// A virtual RGB-D sensor: an OpenNI2 driver that plays frames from files as live devices through the
// unmodified OpenNI2 library. How it is steered: tests/virtual_sensor/__init__.py.
#include "device.h"

// What a device's words say of it, as the library wants it.
static OniDeviceInfo describe(const DeviceControl& words) {
    OniDeviceInfo info{};
    setText(info.uri, words.uri);
    setText(info.vendor, words.vendor);
    setText(info.name, words.name);
    info.usbVendorId = uint16_t(words.usb_vendor);
    info.usbProductId = uint16_t(words.usb_product);
    return info;
}

class SensorDriver : public DriverBase {
public:
    explicit SensorDriver(OniDriverServices* services) : DriverBase(services) {}

    OniStatus initialize(DeviceConnectedCallback connected, DeviceDisconnectedCallback gone,
                         DeviceStateChangedCallback changed, void* cookie) override {
        DriverBase::initialize(connected, gone, changed, cookie);
        for (Control* control : findControls()) {
            known_.push_back({control, {}, false, false, control->device.plugs, 0});
            control->device.loads++;
            if (shown(*control)) connect(known_.back());
        }
        if (!known_.empty()) watcher_ = std::thread(&SensorDriver::watch, this);
        return ONI_STATUS_OK;
    }
    DeviceBase* deviceOpen(const char* uri, const char*) override {
        Known* found = nullptr;
        for (Known& one : known_)
            if (!std::strcmp(one.info.uri, uri)) found = &one;
        if (!found || found->gone) {
            getServices().errorLoggerAppend("Could not find device %s", uri);
            return nullptr;
        }
        Control& control = *found->control;
        mayHang(control, Call::OPEN);
        const int64_t fault = control.device.open_fault;
        if (fault != OpenFault::NONE || !control.device.plugged || found->plugs != control.device.plugs) {
            getServices().errorLoggerAppend("Could not open \"%s\": %s", uri,
                fault == OpenFault::BUSY ? "Failed to set USB interface!" : "Failed to open the USB device!");
            return nullptr;
        }
        Device* device = new Device(control, [this, &control] {
            control.device.plugged = false;
            control.device.plugs++;
            look();
        });
        if (device->ok) {
            control.device.opens++;
            return device;
        }
        getServices().errorLoggerAppend("%s is not a frame file of the virtual sensor", control.device.clip);
        delete device;
        return nullptr;
    }
    void deviceClose(DeviceBase* device) override {
        Control& control = static_cast<Device*>(device)->control();
        mayHang(control, Call::CLOSE);
        delete static_cast<Device*>(device);
        control.device.closes++;
        // Freenect's driver forgets what it closed: this process cannot open it a second time.
        for (Known& one : known_)
            if (one.control == &control) one.gone = control.device.driver == Driver::FREENECT;
    }
    OniStatus tryDevice(const char*) override { return ONI_STATUS_ERROR; }
    void* enableFrameSync(StreamBase**, int) override {
        for (Known& one : known_)
            if (one.control->device.driver == Driver::FREENECT || one.control->device.driver == Driver::BARE)
                return nullptr;
        for (Known& one : known_) one.control->device.synchronized = true;
        return this;
    }
    void disableFrameSync(void*) override {
        for (Known& one : known_) one.control->device.synchronized = false;
    }
    void shutdown() override {
        for (Known& one : known_) mayHang(*one.control, Call::SHUTDOWN);
        closing_ = true;
        if (watcher_.joinable()) watcher_.join();
    }

private:
    struct Known {
        Control* control;
        OniDeviceInfo info;
        bool connected, gone;
        int64_t plugs;  // how often it had been pulled when it was announced
        int64_t state;
    };
    std::vector<Known> known_;
    std::atomic<bool> closing_{false};
    std::mutex looking_;
    std::thread watcher_;

    static bool shown(const Control& control) { return control.device.plugged && control.device.announced; }
    void connect(Known& one) {
        one.info = describe(one.control->device);
        one.connected = true;
        one.plugs = one.control->device.plugs;
        one.state = one.control->device.state;
        deviceConnected(&one.info);
    }
    void look() {
        std::lock_guard<std::mutex> lock(looking_);
        for (Known& one : known_) {
            const DeviceControl& words = one.control->device;
            if (words.hotplug && one.connected && (!shown(*one.control) || one.plugs != words.plugs)) {
                one.connected = false;
                deviceDisconnected(&one.info);
            }
            if (words.hotplug && !one.connected && shown(*one.control)) connect(one);
            if (one.connected && one.state != words.state) {
                one.state = words.state;
                deviceStateChanged(&one.info, int(one.state));
            }
        }
    }
    void watch() {
        nameThread();
        while (!closing_) {
            look();
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
    }
};

ONI_EXPORT_DRIVER(SensorDriver)
