//! Embree 4: the backend of production runs.
#![allow(unsafe_code)]

use std::any::Any;
use std::cell::OnceCell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::mem::{offset_of, size_of};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::ptr;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use embree4_sys as sys;
use glam::Vec3;

use super::{Coherence, Hit, HitFilter, PartKind, Ray, RayBackend, RayScene, TriangleSet, Visible};
use crate::error::{Error, Result};

/// Mask of all geometries but panes.
const MASK_SOLID: u32 = 1;
/// Mask of panes.
const MASK_PANE: u32 = 2;

// The shim reads and writes these types in place.
const _: () = {
    assert!(size_of::<Ray>() == size_of::<sys::gsii_embree_ray>());
    assert!(offset_of!(Ray, origin) == offset_of!(sys::gsii_embree_ray, origin));
    assert!(offset_of!(Ray, t_near) == offset_of!(sys::gsii_embree_ray, t_near));
    assert!(offset_of!(Ray, direction) == offset_of!(sys::gsii_embree_ray, direction));
    assert!(offset_of!(Ray, t_far) == offset_of!(sys::gsii_embree_ray, t_far));
    assert!(size_of::<Hit>() == size_of::<sys::gsii_embree_hit>());
    assert!(offset_of!(Hit, t) == offset_of!(sys::gsii_embree_hit, t));
    assert!(offset_of!(Hit, u) == offset_of!(sys::gsii_embree_hit, u));
    assert!(offset_of!(Hit, v) == offset_of!(sys::gsii_embree_hit, v));
    assert!(offset_of!(Hit, triangle) == offset_of!(sys::gsii_embree_hit, triangle));
    assert!(Hit::NONE == sys::GSII_EMBREE_MISS);
    assert!(size_of::<Vec3>() == 12 && size_of::<[u32; 3]>() == 12);
};

fn failed(reason: impl Into<String>) -> Error {
    Error::Backend { backend: "embree", reason: reason.into() }
}

/// What Embree reports about one device through its callbacks.
#[derive(Default)]
struct Monitor {
    bytes: AtomicI64,
    /// The first error since the last check.
    error: Mutex<Option<String>>,
}

impl Monitor {
    fn take_error(&self) -> Option<String> {
        self.error.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

fn describe(code: sys::RTCError, text: Option<&CStr>) -> String {
    let kind = match code {
        sys::RTCError::RTC_ERROR_INVALID_ARGUMENT => "invalid argument",
        sys::RTCError::RTC_ERROR_INVALID_OPERATION => "invalid operation",
        sys::RTCError::RTC_ERROR_OUT_OF_MEMORY => "out of memory",
        sys::RTCError::RTC_ERROR_UNSUPPORTED_CPU => "this processor is not supported",
        sys::RTCError::RTC_ERROR_CANCELLED => "cancelled",
        _ => "unknown error",
    };
    match text.map(CStr::to_string_lossy) {
        Some(text) if !text.is_empty() => format!("{kind}: {text}"),
        _ => kind.to_owned(),
    }
}

unsafe extern "C" fn on_error(user: *mut c_void, code: sys::RTCError, text: *const c_char) {
    // SAFETY: `user` is the device's `Monitor`, which outlives the device.
    let monitor = unsafe { &*user.cast::<Monitor>() };
    // SAFETY: Embree passes null or a NUL-terminated string that lives during the call.
    let text = (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) });
    let mut error = monitor.error.lock().unwrap_or_else(PoisonError::into_inner);
    error.get_or_insert_with(|| describe(code, text));
}

unsafe extern "C" fn on_memory(user: *mut c_void, bytes: isize, _done: bool) -> bool {
    // SAFETY: `user` is the device's `Monitor`, which outlives the device.
    let monitor = unsafe { &*user.cast::<Monitor>() };
    monitor.bytes.fetch_add(bytes as i64, Ordering::Relaxed);
    true
}

/// An Embree device. Each scene has its own, so that errors and memory are told apart.
struct Device {
    raw: sys::RTCDevice,
    monitor: Arc<Monitor>,
}

// SAFETY: Embree's devices may be used from any thread; the monitor is `Sync`.
unsafe impl Send for Device {}
// SAFETY: as above.
unsafe impl Sync for Device {}

impl Device {
    /// `threads` build the acceleration structure; 0 for as many as there are cores.
    fn new(threads: usize) -> Result<Self> {
        // Where one thread is allowed, oneTBB starts a second for Embree's tasks and never lets it work or sleep: it takes a whole core
        // for as long as the device lives (oneTBB issue 1417).
        let threads = if threads == 1 { 2 } else { threads };
        let config = CString::new(format!("threads={threads}")).map_err(|e| failed(e.to_string()))?;
        // SAFETY: `config` is NUL-terminated and only read during the call.
        let raw = unsafe { sys::rtcNewDevice(config.as_ptr()) };
        if raw.is_null() {
            // SAFETY: the null device stands for errors of device creation on this thread.
            let code = unsafe { sys::rtcGetDeviceError(ptr::null_mut()) };
            return Err(failed(describe(code, None)));
        }
        let device = Device { raw, monitor: Arc::default() };
        let user = Arc::as_ptr(&device.monitor).cast_mut().cast::<c_void>();
        // SAFETY: the device is alive; `Drop` clears the callbacks before the monitor can go.
        unsafe {
            sys::rtcSetDeviceErrorFunction(raw, Some(on_error), user);
            sys::rtcSetDeviceMemoryMonitorFunction(raw, Some(on_memory), user);
        }
        Ok(device)
    }

    fn property(&self, property: sys::RTCDeviceProperty) -> isize {
        // SAFETY: the device is alive.
        unsafe { sys::rtcGetDeviceProperty(self.raw, property) as isize }
    }

    fn check(&self) -> Result<()> {
        self.monitor.take_error().map_or(Ok(()), |reason| Err(failed(reason)))
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: the device is alive, and nothing made from it is (it is dropped last by those who own it).
        unsafe {
            sys::rtcSetDeviceErrorFunction(self.raw, None, ptr::null_mut());
            sys::rtcSetDeviceMemoryMonitorFunction(self.raw, None, ptr::null_mut());
            sys::rtcReleaseDevice(self.raw);
        }
    }
}

/// A buffer that Embree owns and geometries share.
struct Buffer(sys::RTCBuffer);

impl Buffer {
    /// Copies `data`, and leaves room behind it for Embree's 16-byte loads of the last three floats.
    fn copy_of<T: Copy>(device: &Device, data: &[T]) -> Result<Self> {
        let bytes = size_of_val(data);
        // SAFETY: the device is alive.
        let buffer = Buffer(unsafe { sys::rtcNewBuffer(device.raw, bytes + 16) });
        device.check()?;
        // SAFETY: the buffer was made just now.
        let target = if buffer.0.is_null() { ptr::null_mut() } else { unsafe { sys::rtcGetBufferData(buffer.0) } };
        if target.is_null() {
            return Err(failed(format!("no buffer of {bytes} bytes")));
        }
        // SAFETY: `target` has room for `bytes` and 16 more; `data` has `bytes`; they do not overlap.
        unsafe {
            ptr::copy_nonoverlapping(data.as_ptr().cast::<u8>(), target.cast::<u8>(), bytes);
            ptr::write_bytes(target.cast::<u8>().add(bytes), 0, 16);
        }
        Ok(buffer)
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if !self.0.is_null() {
            // SAFETY: gives up our reference; geometries hold their own.
            unsafe { sys::rtcReleaseBuffer(self.0) };
        }
    }
}

struct Geometry(sys::RTCGeometry);

impl Drop for Geometry {
    fn drop(&mut self) {
        if !self.0.is_null() {
            // SAFETY: gives up our reference; the scene holds its own.
            unsafe { sys::rtcReleaseGeometry(self.0) };
        }
    }
}

struct Scene(sys::RTCScene);

impl Drop for Scene {
    fn drop(&mut self) {
        if !self.0.is_null() {
            // SAFETY: the scene is alive and nothing traces through it any more.
            unsafe { sys::rtcReleaseScene(self.0) };
        }
    }
}

/// Embree 4 as [`RayBackend`].
pub struct EmbreeBackend {
    threads: usize,
    version: (isize, isize, isize),
}

impl EmbreeBackend {
    /// `threads` build the acceleration structures, at least two; 0 for as many as there are cores. Rays are traced in the
    /// threads that ask.
    ///
    /// # Errors
    /// [`Error::Backend`] when Embree does not start, or is not the version this program was built for.
    pub fn new(threads: usize) -> Result<Self> {
        let device = Device::new(threads)?;
        let part = |property| device.property(property);
        let version = (
            part(sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_VERSION_MAJOR),
            part(sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_VERSION_MINOR),
            part(sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_VERSION_PATCH),
        );
        let headers =
            (sys::RTC_VERSION_MAJOR as isize, sys::RTC_VERSION_MINOR as isize, sys::RTC_VERSION_PATCH as isize);
        if version.0 != headers.0 || version < headers {
            return Err(failed(format!(
                "the library is version {}.{}.{}, but this program was built with the headers of {}.{}.{}; build it anew",
                version.0, version.1, version.2, headers.0, headers.1, headers.2
            )));
        }
        for (property, what) in [
            (sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_TRIANGLE_GEOMETRY_SUPPORTED, "triangles"),
            (sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED, "ray masks"),
            (sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_FILTER_FUNCTION_SUPPORTED, "filter functions"),
        ] {
            if device.property(property) == 0 {
                return Err(failed(format!("the library was built without {what}")));
            }
        }
        if device.property(sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_BACKFACE_CULLING_ENABLED) != 0 {
            return Err(failed(
                "the library was built with back-face culling: surfaces would be seen from one side only",
            ));
        }
        check_layout(device)?;
        Ok(EmbreeBackend { threads, version })
    }
}

/// Traces one ray with guard bytes behind `RTCRayHit`: a library whose struct is larger than that of our headers
/// (4.3 added `instPrimID`) writes past its end on every hit.
fn check_layout(device: Device) -> Result<()> {
    const GUARD: u8 = 0xa5;
    #[repr(C, align(64))]
    struct Guarded {
        ray_hit: sys::RTCRayHit,
        guard: [u8; 64],
    }
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let set = TriangleSet {
        positions: &positions,
        triangles: &[[0, 1, 2]],
        parts: &[super::Part { triangles: 0..1, kind: PartKind::Opaque }],
        filter: None,
    };
    let scene = EmbreeScene::build(device, &set)?;
    let mut guarded = Guarded { ray_hit: sys::RTCRayHit::default(), guard: [GUARD; 64] };
    let ray = &mut guarded.ray_hit.ray;
    (ray.org_x, ray.org_y, ray.org_z) = (0.25, 0.5, -2.0);
    ray.dir_z = 1.0;
    (ray.tfar, ray.mask) = (f32::INFINITY, u32::MAX);
    guarded.ray_hit.hit.geomID = u32::MAX;
    // SAFETY: the scene is committed, the struct initialised and aligned to 64 bytes; null arguments are the defaults.
    unsafe { sys::rtcIntersect1(scene.scene.0, &mut guarded.ray_hit, ptr::null_mut()) };
    let hit = &guarded.ray_hit.hit;
    // Misplaced fields hold something else altogether; how Embree rounds does not matter here.
    let near = |value: f32, expected: f32| (value - expected).abs() < 1e-3;
    let read_back = near(guarded.ray_hit.ray.tfar, 2.0)
        && near(hit.u, 0.25)
        && near(hit.v, 0.5)
        && (hit.Ng_x, hit.Ng_y, hit.Ng_z) == (0.0, 0.0, 1.0)
        && (hit.geomID, hit.primID) == (0, 0);
    if !read_back || guarded.guard != [GUARD; 64] {
        return Err(failed(
            "the library's data layout is not that of the headers this program was built with; build it anew",
        ));
    }
    Ok(())
}

impl RayBackend for EmbreeBackend {
    fn name(&self) -> String {
        format!("embree {}.{}.{}", self.version.0, self.version.1, self.version.2)
    }

    fn build(&self, set: &TriangleSet<'_>) -> Result<Box<dyn RayScene>> {
        set.check().map_err(failed)?;
        Ok(Box::new(EmbreeScene::build(Device::new(self.threads)?, set)?))
    }
}

/// A committed scene: read-only from here on.
struct EmbreeScene {
    // In this order: Embree counts references, but the device's callbacks need its monitor to the very last.
    scene: Scene,
    device: Device,
    parts: Vec<sys::gsii_embree_part>,
    /// Whether any hit must be put to the shim's filter.
    filters: bool,
    filter: Option<Arc<dyn HitFilter>>,
    packets: bool,
}

// SAFETY: the scene is committed and never changed again; Embree allows ray queries on it from any thread.
unsafe impl Send for EmbreeScene {}
// SAFETY: as above; each query has its own context.
unsafe impl Sync for EmbreeScene {}

impl EmbreeScene {
    /// `set` must have passed [`TriangleSet::check`]: Embree reads vertices by index without looking.
    fn build(device: Device, set: &TriangleSet<'_>) -> Result<Self> {
        let kinds: Vec<_> = set
            .parts
            .iter()
            .map(|part| match part.kind {
                PartKind::OneSided => sys::gsii_embree_kind::GSII_EMBREE_ONE_SIDED,
                PartKind::Filtered if set.filter.is_some() => sys::gsii_embree_kind::GSII_EMBREE_FILTERED,
                PartKind::Filtered | PartKind::Opaque | PartKind::Pane => sys::gsii_embree_kind::GSII_EMBREE_OPAQUE,
            })
            .collect();
        let filters = kinds.iter().any(|&kind| kind != sys::gsii_embree_kind::GSII_EMBREE_OPAQUE);

        // SAFETY: the device is alive.
        let scene = Scene(unsafe { sys::rtcNewScene(device.raw) });
        device.check()?;
        let mut flags = sys::RTCSceneFlags::RTC_SCENE_FLAG_ROBUST;
        if filters {
            flags |= sys::RTCSceneFlags::RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;
        }
        // SAFETY: the scene is alive (a null scene would have been reported above) and not committed yet.
        unsafe {
            sys::rtcSetSceneFlags(scene.0, flags);
            sys::rtcSetSceneBuildQuality(scene.0, sys::RTCBuildQuality::RTC_BUILD_QUALITY_HIGH);
        }
        if !set.triangles.is_empty() {
            let positions = Buffer::copy_of(&device, set.positions)?;
            let triangles = Buffer::copy_of(&device, set.triangles)?;
            for ((id, part), &kind) in (0u32..).zip(set.parts).zip(&kinds) {
                if part.triangles.is_empty() {
                    continue;
                }
                // SAFETY: the device is alive.
                let geometry = Geometry(unsafe {
                    sys::rtcNewGeometry(device.raw, sys::RTCGeometryType::RTC_GEOMETRY_TYPE_TRIANGLE)
                });
                device.check()?;
                // SAFETY: all handles are alive; both buffers hold as many items as stated (the part lies within
                // `triangles`, as `TriangleSet::check` has seen) and are padded; the scene keeps what it needs.
                unsafe {
                    sys::rtcSetGeometryBuffer(
                        geometry.0,
                        sys::RTCBufferType::RTC_BUFFER_TYPE_VERTEX,
                        0,
                        sys::RTCFormat::RTC_FORMAT_FLOAT3,
                        positions.0,
                        0,
                        size_of::<Vec3>(),
                        set.positions.len(),
                    );
                    sys::rtcSetGeometryBuffer(
                        geometry.0,
                        sys::RTCBufferType::RTC_BUFFER_TYPE_INDEX,
                        0,
                        sys::RTCFormat::RTC_FORMAT_UINT3,
                        triangles.0,
                        part.triangles.start as usize * size_of::<[u32; 3]>(),
                        size_of::<[u32; 3]>(),
                        part.triangles.len(),
                    );
                    let mask = if part.kind == PartKind::Pane { MASK_PANE } else { MASK_SOLID };
                    sys::rtcSetGeometryMask(geometry.0, mask);
                    sys::rtcSetGeometryBuildQuality(geometry.0, sys::RTCBuildQuality::RTC_BUILD_QUALITY_HIGH);
                    sys::rtcSetGeometryEnableFilterFunctionFromArguments(
                        geometry.0,
                        kind != sys::gsii_embree_kind::GSII_EMBREE_OPAQUE,
                    );
                    sys::rtcCommitGeometry(geometry.0);
                    sys::rtcAttachGeometryByID(scene.0, geometry.0, id);
                }
                device.check()?;
            }
        }
        // SAFETY: the scene is alive; its geometries are committed.
        unsafe { sys::rtcCommitScene(scene.0) };
        device.check()?;
        let parts = set
            .parts
            .iter()
            .zip(&kinds)
            .map(|(part, kind)| sys::gsii_embree_part { first_triangle: part.triangles.start, kind: kind.0 })
            .collect();
        let packets = device.property(sys::RTCDeviceProperty::RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0;
        Ok(EmbreeScene { scene, device, parts, filters, filter: set.filter.clone(), packets })
    }

    /// Calls `trace` with what the shim needs to know, and goes on with a panic of the filter, if there was one.
    fn query(&self, visible: Visible, coherence: Coherence, trace: impl FnOnce(&sys::gsii_embree_query)) {
        let call = self.filter.as_deref().map(|filter| FilterCall { filter, panic: OnceCell::new() });
        let query = sys::gsii_embree_query {
            scene: self.scene.0,
            parts: self.parts.as_ptr(),
            mask: match visible {
                Visible::All => MASK_SOLID | MASK_PANE,
                Visible::WithoutPanes => MASK_SOLID,
                Visible::OnlyPanes => MASK_PANE,
            },
            coherent: coherence == Coherence::Coherent,
            packets: self.packets,
            filters: self.filters,
            filter: Some(accepts),
            user: call.as_ref().map_or(ptr::null_mut(), |call| ptr::from_ref(call).cast_mut().cast()),
        };
        trace(&query);
        if let Some(payload) = call.and_then(|call| call.panic.into_inner()) {
            resume_unwind(payload);
        }
    }
}

/// The filter of one batch, and the panic that came out of it.
struct FilterCall<'a> {
    filter: &'a dyn HitFilter,
    panic: OnceCell<Box<dyn Any + Send>>,
}

unsafe extern "C" fn accepts(user: *mut c_void, triangle: u32, u: f32, v: f32) -> bool {
    // SAFETY: the shim calls this only for parts of kind FILTERED, which exist only when there is a filter; then
    // `user` is the `FilterCall` of this batch, alive in the frame of `query` on this same thread.
    let call = unsafe { &*user.cast::<FilterCall<'_>>() };
    if call.panic.get().is_some() {
        return true; // the batch is lost: end it soon
    }
    catch_unwind(AssertUnwindSafe(|| call.filter.accepts(triangle, u, v))).unwrap_or_else(|payload| {
        // Cannot be occupied: it was empty above, and only this thread fills it.
        let _ = call.panic.set(payload);
        true
    })
}

impl RayScene for EmbreeScene {
    fn closest(&self, rays: &[Ray], visible: Visible, coherence: Coherence, hits: &mut [Hit]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        self.query(visible, coherence, |query| {
            // SAFETY: layouts agree (checked at compile time), lengths agree (checked above), the scene is committed.
            unsafe { sys::gsii_embree_closest(query, rays.as_ptr().cast(), hits.as_mut_ptr().cast(), rays.len()) }
        });
    }

    fn occluded(&self, rays: &[Ray], visible: Visible, coherence: Coherence, occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        self.query(visible, coherence, |query| {
            // SAFETY: as for `closest`; the shim writes only true and false, and Rust's bool is C's.
            unsafe { sys::gsii_embree_occluded(query, rays.as_ptr().cast(), occluded.as_mut_ptr(), rays.len()) }
        });
    }

    fn memory_bytes(&self) -> usize {
        self.device.monitor.bytes.load(Ordering::Relaxed).try_into().unwrap_or(0)
    }
}
