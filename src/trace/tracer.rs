//! The scene in Embree, and its two queries: the closest hit and occlusion.

use std::cell::RefCell;
use std::marker::PhantomData;
use std::sync::atomic::{AtomicBool, Ordering};

use embree4_rs::Device;
use embree4_rs::geometry::{Geometry, TriangleMeshGeometry};
use embree4_sys as sys;
use glam::{Vec2, Vec3};

use super::ffi::{self, AlignedRay, RayHit};
use super::{TraceError, alpha};
use crate::scene::{Scene, TriangleIndex};

/// A ray: the points `origin + t·direction` with t in `[0, t_max]`. A finite `t_max` makes it a segment.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    pub origin: Vec3,
    /// Of any length above zero. `t` is measured in this length.
    pub direction: Vec3,
    pub t_max: f32,
    /// Seed of the chance with which BLEND surfaces stop the ray. Rays of different salts are stopped independently.
    pub salt: u32,
}

impl Ray {
    pub fn new(origin: Vec3, direction: Vec3, salt: u32) -> Ray {
        Ray { origin, direction, t_max: f32::INFINITY, salt }
    }

    /// The segment between two points, ends included.
    pub fn segment(from: Vec3, to: Vec3, salt: u32) -> Ray {
        Ray { origin: from, direction: to - from, t_max: 1.0, salt }
    }

    fn to_embree(self) -> sys::RTCRay {
        sys::RTCRay {
            org_x: self.origin.x,
            org_y: self.origin.y,
            org_z: self.origin.z,
            tnear: 0.0,
            dir_x: self.direction.x,
            dir_y: self.direction.y,
            dir_z: self.direction.z,
            time: 0.0,
            tfar: self.t_max,
            mask: u32::MAX,
            id: self.salt,
            flags: 0,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance in units of the length of the ray's direction.
    pub t: f32,
    pub triangle: TriangleIndex,
    /// Weights of the triangle's second and third vertex.
    pub barycentric: Vec2,
}

/// A committed Embree scene over all triangles of a [`Scene`].
///
/// Opaque triangles are geometry 0. Triangles with an alpha test and covered ones are geometry 1, and only these have the
/// filter function, so other triangles cost nothing extra. Any number of threads may query at once.
pub struct Tracer<'s> {
    handle: sys::RTCScene,
    /// First triangle of each geometry.
    first_triangle: [u32; 2],
    /// Set while rays are logged for [`Tracer::replay`].
    recording: AtomicBool,
    /// Released after the scene handle, because `Drop` below runs before the fields are dropped.
    _device: Device,
    _scene: PhantomData<&'s Scene>,
}

// SAFETY: a committed Embree scene is immutable, and Embree allows concurrent queries on it.
unsafe impl Sync for Tracer<'_> {}
// SAFETY: Embree's handles are reference-counted atomically and not bound to a thread.
unsafe impl Send for Tracer<'_> {}

impl<'s> Tracer<'s> {
    /// Builds the acceleration structure.
    ///
    /// The build uses one thread on every machine, because equal input must give equal bytes. In a parallel build the
    /// order of a leaf's triangles depends on timing, and this order decides between surfaces at equal distance.
    pub fn build(scene: &'s Scene) -> Result<Tracer<'s>, TraceError> {
        // The bindings pass this string to C unchanged, so it must end with a NUL.
        let device = Device::try_new(Some("threads=1,set_affinity=0\0"))
            .map_err(|e| TraceError::Embree { action: "start", reason: e.to_string() })?;
        let device_handle = device_handle(&device);
        check_version(device_handle)?;

        // SAFETY: the device is live.
        let handle = unsafe { sys::rtcNewScene(device_handle) };
        check(&device, "make a scene")?;
        let tracer = Tracer {
            handle,
            first_triangle: [0, scene.mesh.opaque_count as u32],
            recording: AtomicBool::new(false),
            _device: device,
            _scene: PhantomData,
        };
        tracer.commit(scene)?;
        Ok(tracer)
    }

    fn commit(&self, scene: &'s Scene) -> Result<(), TraceError> {
        // SAFETY: the handle is live and not yet shared.
        // ROBUST: no ray passes between two triangles that share an edge.
        unsafe {
            sys::rtcSetSceneFlags(self.handle, sys::RTCSceneFlags::ROBUST);
            sys::rtcSetSceneBuildQuality(self.handle, sys::RTCBuildQuality::HIGH);
        }
        let positions: Vec<(f32, f32, f32)> = scene.mesh.positions.iter().map(|p| (p.x, p.y, p.z)).collect();
        let (opaque, tested) = scene.mesh.triangles.split_at(scene.mesh.opaque_count);
        for (id, triangles) in [opaque, tested].into_iter().enumerate() {
            if triangles.is_empty() {
                continue;
            }
            let indices: Vec<(u32, u32, u32)> = triangles.iter().map(|t| (t[0], t[1], t[2])).collect();
            let geometry = TriangleMeshGeometry::try_new(&self._device, &positions, &indices)
                .map_err(|e| TraceError::Embree { action: "take the triangles", reason: e.to_string() })?;
            // SAFETY: geometry and scene are live; the scene keeps its own reference to the geometry. The user
            // pointer lives as long as the tracer, whose lifetime is tied to the scene's.
            unsafe {
                if id == 1 {
                    sys::rtcSetGeometryUserData(*geometry.handle(), alpha::user_pointer(scene));
                    sys::rtcSetGeometryIntersectFilterFunction(*geometry.handle(), Some(alpha::filter));
                    sys::rtcSetGeometryOccludedFilterFunction(*geometry.handle(), Some(alpha::filter));
                    sys::rtcCommitGeometry(*geometry.handle());
                }
                sys::rtcAttachGeometryByID(self.handle, *geometry.handle(), id as u32);
            }
            check(&self._device, "attach the triangles")?;
        }
        // SAFETY: the handle is live and not yet shared.
        unsafe { sys::rtcCommitScene(self.handle) };
        check(&self._device, "build its acceleration structure")
    }

    /// The nearest surface that stops the ray.
    #[inline]
    pub fn closest(&self, ray: Ray) -> Option<Hit> {
        self.log(Question::Closest, ray);
        let mut ray_hit = RayHit::new(ray.to_embree());
        // SAFETY: committed in `build`, immutable since.
        unsafe { ffi::intersect(self.handle, &mut ray_hit) };
        debug_assert_eq!(ray_hit.canary, ffi::CANARY);
        let hit = &ray_hit.base.hit;
        if hit.geomID == sys::RTC_INVALID_GEOMETRY_ID {
            return None;
        }
        Some(Hit {
            t: ray_hit.base.ray.tfar,
            triangle: TriangleIndex(self.first_triangle[hit.geomID as usize] + hit.primID),
            barycentric: Vec2::new(hit.u, hit.v),
        })
    }

    /// Whether any surface stops the ray within `t_max`.
    #[inline]
    pub fn occluded(&self, ray: Ray) -> bool {
        self.log(Question::Occluded, ray);
        // SAFETY: committed in `build`, immutable since.
        unsafe { ffi::occluded(self.handle, &mut AlignedRay(ray.to_embree())) }
    }
}

/// The query that a logged ray was for.
#[derive(Debug, Clone, Copy)]
enum Question {
    Closest,
    Occluded,
}

/// The rays of one call of [`Tracer::record`], in order. They serve to measure the time that Embree alone takes.
#[derive(Debug, Clone, Default)]
pub struct RayLog(Vec<(Question, Ray)>);

impl RayLog {
    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

thread_local! {
    static LOG: RefCell<Vec<(Question, Ray)>> = const { RefCell::new(Vec::new()) };
}

impl Tracer<'_> {
    /// Turns logging on or off, for all threads.
    pub fn set_recording(&self, on: bool) {
        self.recording.store(on, Ordering::SeqCst);
    }

    #[inline]
    fn log(&self, question: Question, ray: Ray) {
        if self.recording.load(Ordering::Relaxed) {
            LOG.with_borrow_mut(|log| log.push((question, ray)));
        }
    }

    /// Runs `work` on this thread and returns the rays that it traced on this thread while recording was on.
    pub fn record(&self, work: impl FnOnce()) -> RayLog {
        LOG.take();
        work();
        RayLog(LOG.take())
    }

    /// Traces the logged rays again and ignores the results.
    pub fn replay(&self, log: &RayLog) {
        for (question, ray) in &log.0 {
            // SAFETY: committed in `build`, immutable since.
            unsafe {
                match question {
                    Question::Closest => {
                        let mut ray_hit = RayHit::new(ray.to_embree());
                        ffi::intersect(self.handle, &mut ray_hit);
                        std::hint::black_box(ray_hit.base.ray.tfar);
                    }
                    Question::Occluded => {
                        std::hint::black_box(ffi::occluded(self.handle, &mut AlignedRay(ray.to_embree())));
                    }
                }
            }
        }
    }
}

impl Drop for Tracer<'_> {
    fn drop(&mut self) {
        // SAFETY: this is the only release of the reference that `rtcNewScene` returned.
        unsafe { sys::rtcReleaseScene(self.handle) };
    }
}

/// The handle inside the crate's device. The crate does not expose it.
fn device_handle(device: &Device) -> sys::RTCDevice {
    const { assert!(size_of::<Device>() == size_of::<sys::RTCDevice>()) };
    // SAFETY: `Device` has the size of its only field, the handle, which therefore lies at offset 0.
    unsafe { std::ptr::from_ref(device).cast::<sys::RTCDevice>().read() }
}

fn check(device: &Device, action: &'static str) -> Result<(), TraceError> {
    match device.error() {
        None => Ok(()),
        Some(error) => Err(TraceError::Embree { action, reason: format!("{error:?}") }),
    }
}

/// Refuses an Embree library older than version 4.
fn check_version(device: sys::RTCDevice) -> Result<(), TraceError> {
    // SAFETY: the device is live.
    let version = unsafe { sys::rtcGetDeviceProperty(device, sys::RTCDeviceProperty::VERSION) };
    // Embree reports version 4.3.2 as 40302.
    if version < 40_000 {
        let found = format!("{}.{}.{}", version / 10_000, version / 100 % 100, version % 100);
        return Err(TraceError::TooOld { found });
    }
    Ok(())
}
