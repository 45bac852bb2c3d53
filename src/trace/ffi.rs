//! The memory layouts shared with Embree and the few calls made on them.

use std::ptr::null_mut;

use embree4_sys::{RTCRay, RTCRayHit, RTCScene};

/// `RTCRayHit` of the bindings (Embree 4.2) and the field that 4.3 and later write behind it.
#[repr(C, align(16))]
pub struct RayHit {
    pub base: RTCRayHit,
    /// `instPrimID` of Embree ≥ 4.3; padding before that.
    inst_prim_id: u32,
    pub canary: [u32; 3],
}

/// Written behind the last field that Embree may write; a test checks that it survives.
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
    // SAFETY: the caller vouches for the scene; `RayHit` has room for what any Embree 4 writes, and is aligned.
    unsafe { embree4_sys::rtcIntersect1(scene, std::ptr::from_mut(ray_hit).cast(), null_mut()) }
}

/// Whether anything lies on the ray. Embree answers by `tfar = −∞`.
///
/// # Safety
/// As [`intersect`].
#[inline]
pub unsafe fn occluded(scene: RTCScene, ray: &mut AlignedRay) -> bool {
    // SAFETY: as above; `RTCRay` has not changed within Embree 4.
    unsafe { embree4_sys::rtcOccluded1(scene, std::ptr::from_mut(ray).cast(), null_mut()) };
    ray.0.tfar < 0.0
}
