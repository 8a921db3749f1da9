// Embree's devices, buffers, geometries and scenes for triangles, on colonnade_rays.h. Structures are as in Embree 4's
// documented binary interface, errors as of its calls.
#pragma once
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "colonnade_rays.h"

namespace colonnade::rays::embree {

enum ErrorCode { none, unknown, invalidArgument, invalidOperation, outOfMemory, cancelled = 6 };
enum BufferType { indexBuffer, vertexBuffer, attributeBuffer };
enum Format { uint3 = 0x5003, float1 = 0x9001, float3 = 0x9003, float16 = 0x9010 };
constexpr unsigned invokeArgumentFilter = 1 << 1; ///< of a query's flags
constexpr unsigned noId = ~0u;

/// A call that fails: its code, and why.
struct Error : std::runtime_error {
    ErrorCode code;
    Error(ErrorCode code, const char* what) : std::runtime_error(what), code(code) {}
};

struct Device;

/// What a handle names, with its references.
struct Object {
    explicit Object(Device* of) : device(of) {}
    virtual ~Object() = default;
    Object(const Object&) = delete;
    Object& operator=(const Object&) = delete;

    void retain() { references_.fetch_add(1, std::memory_order_relaxed); }
    void release() {
        if (references_.fetch_sub(1, std::memory_order_acq_rel) == 1) delete this;
    }

    Device* const device;

private:
    std::atomic<int> references_{1};
};

/// A reference to an object, or null.
template <class T> class Reference {
public:
    Reference(T* to = nullptr) : to_(to) {
        if (to_) to_->retain();
    }
    Reference(const Reference& other) : Reference(other.to_) {}
    Reference(Reference&& other) noexcept : to_(std::exchange(other.to_, nullptr)) {}
    Reference& operator=(Reference other) noexcept {
        std::swap(to_, other.to_);
        return *this;
    }
    ~Reference() {
        if (to_) to_->release();
    }
    /// Takes over the reference that a new object has.
    static Reference of(T* made) {
        Reference result(made);
        made->release();
        return result;
    }

    T* get() const { return to_; }
    T* operator->() const { return to_; }

private:
    T* to_;
};

/// The first error of a thread since it asked last, and the text of the latest such.
struct LastError {
    int code = none;
    std::string text;
};

struct Device final : Object {
    Device() : Object(this) {
        if (const int status = colonnade_rays_open_environment(&rays))
            throw Error(status == COLONNADE_RAYS_NO_MEMORY ? outOfMemory : unknown,
                        "the design or the device does not open");
    }
    ~Device() override { colonnade_rays_close(rays); }

    /// The calling thread's error; of a null device the error of calls without one.
    static LastError& error(const Device* device) {
        thread_local std::map<std::uint64_t, LastError> errors;
        return errors[device ? device->number_ : 0];
    }
    static void fail(Device* device, int code, const char* text) noexcept {
        try {
            if (device && device->report) device->report(device->user, code, text);
            LastError& last = error(device);
            if (last.code == none) last = {code, text};
        } catch (...) {} // Without memory the error is lost
    }
    /// Turns the status of a call of the library into an error.
    void check(int status) {
        if (status == COLONNADE_RAYS_OK) return;
        const bool isHardware = status == COLONNADE_RAYS_DEVICE;
        throw Error(status == COLONNADE_RAYS_NO_MEMORY ? outOfMemory
                    : isHardware                       ? unknown
                                                       : invalidOperation,
                    colonnade_rays_error(rays));
    }

    void (*report)(void*, int, const char*) = nullptr;
    void* user = nullptr;
    colonnade_rays_device* rays = nullptr;

private:
    inline static std::atomic<std::uint64_t> devices{0};
    const std::uint64_t number_ = ++devices; ///< Not used again, as an address is
};

/// An object of a device, which stays as long.
struct Child : Object {
    explicit Child(Device* of) : Object(of) { of->retain(); }
    ~Child() override { device->release(); }
};

inline void* needed(void* handle) {
    if (!handle) throw Error(invalidArgument, "invalid argument");
    return handle;
}

/// Runs a call on a handle, whose failures become errors of its device, or of the thread if the handle is null.
template <class Call> auto called(Object* handle, const Call& call) noexcept -> decltype(call()) {
    Device* const device = handle ? handle->device : nullptr;
    try {
        needed(handle);
        return call();
    } catch (const Error& error) { Device::fail(device, error.code, error.what()); } catch (const std::bad_alloc&) {
        Device::fail(device, outOfMemory, "out of memory");
    } catch (const std::exception& error) { Device::fail(device, unknown, error.what()); }
    return decltype(call())();
}

struct Buffer final : Child {
    /// Memory of its own, if `shared` is null.
    Buffer(Device* of, char* shared, std::size_t size)
        : Child(of), bytes(size), data(shared ? shared : static_cast<char*>(std::calloc(size + 1, 1))),
          isOwned_(!shared) {
        if (!data) throw std::bad_alloc();
    }
    ~Buffer() override {
        if (isOwned_) std::free(data);
    }

    const std::size_t bytes;
    char* const data;

private:
    const bool isOwned_;
};

/// Items in a buffer.
struct View {
    Reference<Buffer> buffer;
    char* data = nullptr;
    std::size_t stride = 0, count = 0;

    template <class T> std::array<T, 3> row(std::size_t i) const {
        std::array<T, 3> values;
        std::memcpy(values.data(), data + i * stride, sizeof values);
        return values;
    }
};

/// What a filter gets. It clears `*valid` to refuse the hit. `ray` has the t of its hit; of a single ray it is the
/// caller's.
struct FilterArguments {
    int* valid;
    void *user, *context, *ray, *hit;
    unsigned count;
};
using Filter = void (*)(const FilterArguments*);
struct QueryArguments {
    unsigned flags, features;
    void* context;
    Filter filter;
};

struct Geometry final : Child {
    using Child::Child;

    View& view(int type, unsigned slot) {
        if (type == attributeBuffer && slot < attributes.size()) return attributes[slot];
        if ((type == indexBuffer || type == vertexBuffer) && slot == 0) return views[type];
        throw Error(type == attributeBuffer ? invalidOperation : invalidArgument,
                    "there is no buffer of this type and slot");
    }

    /// `made`: a function of the bytes that makes the buffer.
    template <class Make> View& set(int type, unsigned slot, int format, std::size_t offset, std::size_t stride,
                                    std::size_t count, const Make& make) {
        if (count > UINT32_MAX || stride > UINT32_MAX) throw Error(invalidArgument, "the buffer is too large");
        View& to = view(type, slot);
        if (type == attributeBuffer ? format < float1 || format > float16
                                    : format != (type == indexBuffer ? uint3 : float3))
            throw Error(invalidOperation, "the buffer has another format");
        const Reference<Buffer> buffer = make(stride * count);
        if (((reinterpret_cast<std::uintptr_t>(buffer->data) + offset) | stride) % 4 != 0)
            throw Error(invalidOperation, "data are not aligned to 4 bytes");
        if (offset > buffer->bytes || stride * count > buffer->bytes - offset)
            throw Error(invalidArgument, "the buffer is too small");
        if (type == indexBuffer && count != to.count) change();
        to = {buffer, buffer->data + offset, stride, count};
        return to;
    }

    /// A change that needs a commit.
    void change() {
        isCommitted = false;
        ++changes;
    }
    void enable(bool toBeEnabled) {
        changes += isEnabled != toBeEnabled;
        isEnabled = toBeEnabled;
    }
    bool hasFilters() const { return filters[0] || filters[1] || takesArgumentFilter; }

    View views[2];
    std::vector<View> attributes;
    bool isCommitted = false, isEnabled = true, takesArgumentFilter = false;
    unsigned mask = 1, changes = 0;
    void* user = nullptr;
    Filter filters[2] = {}; ///< of closest hits, of occlusion
};

/// A mesh of a committed scene.
struct Part {
    unsigned id;
    Reference<Geometry> geometry;
    std::vector<std::array<float, 3>> normals; ///< of each face
};

/// What rays meet: the scene at its last commit.
struct Committed {
    explicit Committed(Device& device) { device.check(colonnade_rays_scene_new(device.rays, &rays)); }
    Committed(Committed&& other) noexcept
        : rays(std::exchange(other.rays, nullptr)), parts(std::move(other.parts)), hasFilters(other.hasFilters) {}
    Committed& operator=(Committed&& other) noexcept {
        std::swap(rays, other.rays);
        parts.swap(other.parts);
        hasFilters = other.hasFilters;
        return *this;
    }
    ~Committed() { colonnade_rays_scene_free(rays); }

    /// Adds a geometry. Triangles with an index or a vertex that is none, or a vertex too far away, become points, and
    /// keep their place.
    void add(Device& device, unsigned id, Geometry& geometry) {
        const View &corners = geometry.views[vertexBuffer], &triangles = geometry.views[indexBuffer];
        const std::uint32_t vertexCount = static_cast<std::uint32_t>(corners.count);
        std::vector<double> vertices(3 * corners.count);
        std::vector<bool> isVertex(corners.count, true);
        for (std::size_t i = 0; i < corners.count; ++i) {
            const auto row = corners.row<float>(i);
            for (int a = 0; a < 3; ++a) isVertex[i] = isVertex[i] && std::abs(row[a]) < largest;
            for (int a = 0; a < 3 && isVertex[i]; ++a) vertices[3 * i + a] = row[a];
        }
        std::vector<std::uint32_t> faces(3 * triangles.count, vertexCount);
        std::uint32_t some = vertexCount; // A vertex of a triangle
        for (std::size_t i = 0; i < triangles.count; ++i) {
            const auto row = triangles.row<std::uint32_t>(i);
            bool isFace = true;
            for (const std::uint32_t corner : row) isFace = isFace && corner < vertexCount && isVertex[corner];
            if (!isFace) continue;
            std::copy(row.begin(), row.end(), &faces[3 * i]);
            some = row[0];
        }
        if (some == vertexCount) return;
        std::replace(faces.begin(), faces.end(), vertexCount, some);
        std::uint32_t mesh;
        const int status =
            colonnade_rays_mesh_add(rays, vertices.data(), vertexCount, faces.data(), triangles.count, &mesh);
        if (status == COLONNADE_RAYS_BAD_MESH) return; // No face has an area
        device.check(status);
        device.check(colonnade_rays_mesh_mask(rays, mesh, geometry.mask));
        Part part{id, &geometry, {}};
        part.normals.reserve(triangles.count);
        for (std::size_t i = 0; i < triangles.count; ++i) {
            const double *at[3], *&a = at[0], *&b = at[1], *&c = at[2];
            for (int corner = 0; corner < 3; ++corner) at[corner] = &vertices[3 * std::size_t{faces[3 * i + corner]}];
            const auto component = [&](int x, int y) {
                return static_cast<float>((b[x] - a[x]) * (c[y] - a[y]) - (b[y] - a[y]) * (c[x] - a[x]));
            };
            part.normals.push_back({component(1, 2), component(2, 0), component(0, 1)});
        }
        parts.push_back(std::move(part));
    }

    colonnade_rays_scene* rays = nullptr;
    std::vector<Part> parts; ///< of each mesh
    bool hasFilters = false;

private:
    static constexpr float largest = 1.844e18f; ///< Embree's limit of a coordinate
};

struct Scene final : Child {
    explicit Scene(Device* of) : Child(of), committed(*of) {}

    unsigned attach(Geometry* geometry, unsigned id) {
        needed(geometry);
        if (geometry->device != device) throw Error(invalidArgument, "the geometry is another device's");
        const std::lock_guard lock(table_);
        if (id == noId) {
            while (geometries_.count(firstFree_)) ++firstFree_;
            id = firstFree_;
        }
        if (!geometries_.emplace(id, geometry).second)
            throw Error(invalidOperation, "the scene has a geometry of this number");
        isModified = isModified || geometry->isEnabled;
        return id;
    }
    void detach(unsigned id) {
        if (id == noId) throw Error(invalidArgument, "invalid argument");
        const std::lock_guard lock(table_);
        if (geometries_.erase(id) == 0) throw Error(invalidOperation, "the scene has no such geometry");
        firstFree_ = std::min(firstFree_, id);
        isModified = true;
    }
    /// Null if there is none.
    Geometry* geometry(unsigned id) {
        const std::lock_guard lock(table_);
        const auto found = geometries_.find(id);
        return found == geometries_.end() ? nullptr : found->second.get();
    }

    /// Threads that come during a commit wait for it, and find nothing to do.
    void commit() {
        const std::lock_guard lock(commits_);
        std::vector<Seen> now;
        {
            const std::lock_guard tableLock(table_);
            for (const auto& [id, each] : geometries_) now.push_back({id, each, each->changes});
        }
        const auto isSame = [](const Seen& a, const Seen& b) {
            return a.id == b.id && a.geometry.get() == b.geometry.get() && a.changes == b.changes;
        };
        if (!isModified && std::equal(now.begin(), now.end(), seen_.begin(), seen_.end(), isSame)) return;
        isModified = true;
        Committed empty(*device), next(*device); // The scene is empty if this fails
        device->check(colonnade_rays_commit(empty.rays));
        committed = std::move(empty);
        tell(0);
        for (const Seen& each : now) {
            if (!each.geometry->isEnabled) continue;
            if (!each.geometry->isCommitted) throw Error(invalidOperation, "geometry not committed");
            next.hasFilters = next.hasFilters || each.geometry->hasFilters();
            next.add(*device, each.id, *each.geometry.get());
        }
        device->check(colonnade_rays_commit(next.rays));
        tell(1);
        committed = std::move(next);
        seen_ = std::move(now);
        isModified = false;
    }

    std::atomic<bool> isModified{true};
    int flags = 0;
    bool (*progress)(void*, double) = nullptr;
    void* progressUser = nullptr;
    Committed committed;

private:
    struct Seen {
        unsigned id;
        Reference<Geometry> geometry;
        unsigned changes;
    };

    void tell(double part) const {
        if (progress && !progress(progressUser, part)) throw Error(cancelled, "the progress monitor ends the commit");
    }

    std::mutex table_, commits_;
    std::map<unsigned, Reference<Geometry>> geometries_;
    unsigned firstFree_ = 0; ///< Smaller numbers are taken
    std::vector<Seen> seen_;
};

} // namespace colonnade::rays::embree
