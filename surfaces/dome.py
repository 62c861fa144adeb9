"""An ellipsoidal dome: the cap that the ground cuts off an ellipsoid, 0.9 × 0.7 m in plan and 0.2 m high."""

import math

# how far up the sphere the ground cuts, as the sine of the latitude: 0 is half a sphere, steep at its foot
ROUNDNESS = 0.72


def build(gmsh, *, length=0.90, width=0.70, height=0.20):
    """A spherical cap, stretched along its three axes."""
    occ = gmsh.model.occ
    latitude = math.asin(ROUNDNESS)
    ball = occ.addSphere(0.0, 0.0, -ROUNDNESS, 1.0, angle1=latitude, angle2=0.5 * math.pi)
    skin = [face for face in occ.getEntities(2)]
    occ.remove([(3, ball)])
    radius = math.cos(latitude)
    occ.dilate(skin, 0.0, 0.0, 0.0, 0.5 * length / radius, 0.5 * width / radius, height / (1.0 - ROUNDNESS))
    occ.synchronize()
    for face in skin:  # the base is flat and lies on the ground
        _, _, low, _, _, high = gmsh.model.getBoundingBox(*face)
        if high - low < 0.5 * height:
            occ.remove([face])
