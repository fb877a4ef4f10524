"""Live RGB-D sensors for tests: an OpenNI2 driver of our own under the unmodified OpenNI2 library.

A test writes a clip, makes a `Control` for each device, and starts a process in `environment`::

    write_clip(tmp_path / "clip", [(depth, color), ...])             # or see `scenes`
    sensor = Control(tmp_path / "sensor", tmp_path / "clip", uri="virtual:0", serial="A1")
    env = environment(controls=[sensor])                             # several: several devices
    done = run_python(CODE, env=env)                                 # or a service under that env

While that process runs the test writes fields of the control channel, and the driver obeys within a
frame, a call, or 5 ms; nothing is told to the process itself::

    sensor.unplug(); sensor.replug("virtual:7")       # known to the library, unless `hotplug=False`
    sensor.color.silent = True                        # that stream says nothing more
    sensor.hang = Call.CLOSE | Call.SHUTDOWN          # those calls do not come back ...
    sensor.wait_hanging(Call.CLOSE)
    sensor.hang = Call.NONE                           # ... until this
    sensor.depth.drop_next = 3                        # so too `garbled_next`, `wrong_size_next`
    sensor.state = DeviceState.ERROR                  # and OK again
    sensor.open_fault = OpenFault.BUSY                # at the next attempt to open it
    sensor.color.stamp_offset_us += 1_000_000         # a jump; also `stamps`, `drift_ppm`
    sensor.pipeline_us = 33_000                       # from exposure to delivery

Before the device is opened: `depth.offer(Mode(320, 240, 60))`, `color.present = False` (a sensor
without a colour camera), `driver`, `usb_vendor`, `usb_product`, `depth.mirroring = Honesty.SECRET`,
`registered_at_start`, `color.crop_width`, `settle_frames`, ... `control.py` lists each field with
its meaning. `presets.as_xtion(sensor)`, `as_kinect`, `as_astra`, `as_structure_sensor` set all that
is known of those. Clips: `scenes.cheap_clip` (a ball, outlines where they belong, no face) and
`scenes.face_clip` (a face that moves, with its truth; kept between runs).

The driver counts what it did: `opens`, `closes`, `loads` (processes), `depth.frames` (sent),
`depth.lost`, `depth.running`, `hanging` (a call that hangs now). `wait_frames(n)` waits for n more.

Truth: frame n of a stream is exposed at a fixed instant of the host's monotonic clock and delivered
`pipeline_us` later. With `marks` both images carry n and that instant in their first rows, and
`read_mark(image)` gives them back: from `frame.depth`, `frame.color`, from a preview (also JPEG).
So "exposed after the press" means `read_mark(frame.depth).exposed_ns` at or after the press's
`time.monotonic_ns()`, and the difference of both images' marks is the true skew.

`Raw` is a process that sees the sensor through the bare binding: what the driver really does.
"""
