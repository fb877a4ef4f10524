"""Press once and follow the faces until one's own is there; needs `denseface up`."""

from denseface import Client, save_face

with Client() as client:
    before = client.status().sequence
    pressed = client.press()
    for face in client.faces(after=before, timeout=60):
        name = face.report.capture_id
        print(f"{name}: {len(face.dense)} points, {face.report.noise_mm:.2f} mm of noise")
        if name == pressed:
            save_face(face, f"{name}.ply")
            break
