//! The memory layouts shared with Embree, and the calls that use them.

use std::ptr::null_mut;

use embree4_sys::{RTCRay, RTCRayHit, RTCScene};

/// `RTCRayHit` of the bindings (Embree 4.2), followed by the field that Embree 4.3 and later add.
#[repr(C, align(16))]
pub struct RayHit {
    pub base: RTCRayHit,
    /// `instPrimID` of Embree ≥ 4.3; padding before that.
    inst_prim_id: u32,
    pub canary: [u32; 3],
}

/// A pattern behind the last field that Embree may write. Tests check that it stays unchanged.
pub const CANARY: [u32; 3] = [0x5EED_CAFE, 0x0DDB_A115, 0x1F00_57E9];

/// `RTCRay` with the alignment that the C header asks for.
#[repr(C, align(16))]
pub struct AlignedRay(pub RTCRay);

const _: () = {
    assert!(size_of::<RTCRayHit>() == 80, "the bindings are no longer those of Embree 4.2");
    assert!(size_of::<RayHit>() == 96);
    assert!(std::mem::offset_of!(RayHit, inst_prim_id) == 80);
    assert!(size_of::<AlignedRay>() == 48);
};

impl RayHit {
    pub fn new(ray: RTCRay) -> RayHit {
        let base = RTCRayHit { ray, hit: Default::default() };
        RayHit { base, inst_prim_id: u32::MAX, canary: CANARY }
    }
}

/// Closest hit; fills `ray_hit`.
///
/// # Safety
/// `scene` is a live, committed scene that no one modifies during the call.
#[inline]
pub unsafe fn intersect(scene: RTCScene, ray_hit: &mut RayHit) {
    // SAFETY: the caller guarantees the scene. `RayHit` is aligned and has room for all that Embree 4 writes.
    unsafe { embree4_sys::rtcIntersect1(scene, std::ptr::from_mut(ray_hit).cast(), null_mut()) }
}

/// Whether anything lies on the ray. Embree then sets `tfar = −∞`.
///
/// # Safety
/// As [`intersect`].
#[inline]
pub unsafe fn occluded(scene: RTCScene, ray: &mut AlignedRay) -> bool {
    // SAFETY: as above; `RTCRay` has not changed within Embree 4.
    unsafe { embree4_sys::rtcOccluded1(scene, std::ptr::from_mut(ray).cast(), null_mut()) };
    ray.0.tfar < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use embree4_rs::Device;
    use embree4_rs::geometry::{Geometry, TriangleMeshGeometry};
    use embree4_sys as sys;

    /// A byte that Embree is unlikely to write.
    const FILL: u8 = 0xA5;

    /// A ray-hit between two filled ranges of memory. Each range is larger than any field that Embree might add.
    #[repr(C, align(64))]
    struct Guarded {
        before: [u8; 64],
        ray_hit: RayHit,
        after: [u8; 64],
    }

    /// Embree writes into the 80 bytes of the bindings and the word behind them, and nowhere else. `rtcIntersect1` is
    /// called on several rays, hits and misses, that start from filled memory: every byte that changes is one that
    /// Embree wrote.
    #[test]
    fn embree_stays_within_its_struct() {
        let device = Device::try_new(Some("threads=1\0")).unwrap();
        // SAFETY: `Device` has the size of its only field, the handle.
        let handle = unsafe { std::ptr::from_ref(&device).cast::<sys::RTCDevice>().read() };
        let corners = [(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (0.0, 1.0, 0.0)];
        let triangle = TriangleMeshGeometry::try_new(&device, &corners, &[(0, 1, 2)]).unwrap();
        // SAFETY: device and geometry are live; the scene is released below.
        let (scene, version) = unsafe {
            let scene = sys::rtcNewScene(handle);
            sys::rtcAttachGeometryByID(scene, *triangle.handle(), 0);
            sys::rtcCommitScene(scene);
            (scene, sys::rtcGetDeviceProperty(handle, sys::RTCDeviceProperty::VERSION))
        };
        let (mut hits, mut misses) = (0, 0);
        for i in 0..64 {
            let x = (i as f32 - 32.0) / 16.0;
            let ray =
                RTCRay { org_x: x, org_z: 1.0, dir_z: -1.0, tfar: f32::INFINITY, mask: u32::MAX, ..Default::default() };
            let mut guarded = Guarded { before: [FILL; 64], ray_hit: RayHit::new(ray), after: [FILL; 64] };
            guarded.ray_hit.inst_prim_id = u32::from_ne_bytes([FILL; 4]);
            guarded.ray_hit.base.hit.geomID = sys::RTC_INVALID_GEOMETRY_ID;
            // SAFETY: the scene is live and committed.
            unsafe { intersect(scene, &mut guarded.ray_hit) };
            assert_eq!(guarded.before, [FILL; 64], "Embree wrote before the struct");
            assert_eq!(guarded.after, [FILL; 64], "Embree wrote behind the struct");
            assert_eq!(guarded.ray_hit.canary, CANARY, "Embree wrote behind the field instPrimID");
            let wrote = guarded.ray_hit.inst_prim_id != u32::from_ne_bytes([FILL; 4]);
            if guarded.ray_hit.base.hit.geomID == sys::RTC_INVALID_GEOMETRY_ID {
                misses += 1;
            } else {
                hits += 1;
                // The reason for all this: from 4.3 on the word behind the bindings' struct is written on every hit.
                assert_eq!(wrote, version >= 40_300, "the word behind 80 bytes, Embree {version}");
            }
        }
        assert!(hits > 10 && misses > 10, "{hits} hits, {misses} misses");
        // SAFETY: the only reference.
        unsafe { sys::rtcReleaseScene(scene) };
    }
}
