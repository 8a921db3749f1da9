// The decoded frame registers, which the host writes before a frame.
#pragma once
#include "bounce.hpp"
#include "environment_view.hpp"
#include "gather.hpp"
#include "instances.hpp"

namespace colonnade {

/// Register values by their flattened names.
using Registers = std::map<std::string, std::int64_t>;

/// A half-plane: the pixels with x · px + y · py + offset ≥ 0.
struct HalfPlane {
    std::int64_t x, y, offset;
};

/// The frame registers, decoded.
struct Frame {
    std::int64_t width, height;
    std::array<std::int64_t, 4> objectRectangle;
    std::vector<HalfPlane> objectOutline;
    WideVector cameraPosition;
    Vector cameraDirection, stepX, stepY;
    int stepShift;
    Bounds bounds;
    Lighting lighting;
    std::size_t recordCount;
    std::vector<std::size_t> roots{0}; ///< of the scene's tree, or of each instance's
    std::vector<Instance> instances; ///< none: the scene's tree is in the world's axes
    bool hasColours; ///< each leaf is followed by its companion
    std::uint64_t watchdogCycles;
    bool hasEnvironment;
    EnvironmentView environment;
    Gather gather;

    Frame() = default;
    Frame(const Registers& registers, const Numbers& n) {
        const auto take = [&](const std::string& name) { return lookUp(registers, name); };
        // Registers that a design lacks, e.g. one without bounces, are 0
        const auto takeIfThere = [&](const std::string& name) { return registers.count(name) ? take(name) : 0; };
        const auto vector = [&](const std::string& name, const char* components = "xyz") {
            Vector result;
            for (int i = 0; i < 3; ++i) result[i] = take(name + "." + components[i]);
            return result;
        };
        const int unitShift = static_cast<int>(take("frame.unitShift"));
        const auto position = [&](const std::string& name) {
            const Vector raw = vector(name);
            WideVector steps;
            for (int a = 0; a < 3; ++a) steps[a] = wrapped(shiftLeft<Wide>(raw[a], unitShift), n.sceneBits);
            return steps;
        };
        width = take("frame.width");
        height = take("frame.height");
        objectRectangle = {take("frame.objectRect.x0"), take("frame.objectRect.y0"), take("frame.objectRect.x1"),
                           take("frame.objectRect.y1")};
        for (int i = 0; registers.count(entry("frame.objectOutline", i) + "x"); ++i) {
            const std::string edge = entry("frame.objectOutline", i);
            objectOutline.push_back({take(edge + "x"), take(edge + "y"), take(edge + "offset")});
        }
        cameraPosition = position("camera.position");
        cameraDirection = vector("camera.direction");
        stepX = vector("camera.stepX");
        stepY = vector("camera.stepY");
        stepShift = static_cast<int>(take("camera.stepShift"));
        bounds = {vector("bounds.low"), vector("bounds.high")};
        for (int i = 0; registers.count(entry("lights", i) + "colour.r"); ++i) {
            const std::string name = entry("lights", i);
            lighting.lights.push_back({position(name + "position"), vector(name + "colour", "rgb"),
                                       take(name + "reachMantissa"), static_cast<int>(take(name + "reachExponent"))});
        }
        lighting.lights.resize(std::min(lighting.lights.size(), static_cast<std::size_t>(take("shading.lights"))));
        lighting.ambient = vector("ambient", "rgb");
        lighting.background = vector("background", "rgb");
        lighting.offset = take("shading.offset");
        lighting.shadowTransmittance = takeIfThere("shading.shadowTransmittance");
        lighting.hasTransmittance = registers.count("shading.shadowTransmittance") != 0;
        lighting.flat = take("shading.flat") != 0;
        lighting.shadows = take("shading.shadows") != 0;
        lighting.bounces = static_cast<int>(takeIfThere("shading.bounces"));
        for (int i = 0; registers.count(entry("materials", i) + "albedo.r"); ++i) {
            const std::string name = entry("materials", i);
            lighting.materials.push_back(
                {vector(name + "albedo", "rgb"),
                 takeIfThere(name + "hasCornerColours") != 0,
                 takeIfThere(name + "hasTexture") != 0,
                 registers.count(name + "emission.r") ? vector(name + "emission", "rgb") : Vector{},
                 static_cast<MaterialKind>(takeIfThere(name + "kind")),
                 {takeIfThere(name + "etaFront"), takeIfThere(name + "etaBack")},
                 takeIfThere(name + "reflectance"),
                 {takeIfThere(name + "lobe.alpha"), takeIfThere(name + "lobe.slope"),
                  takeIfThere(name + "lobe.peak")}});
        }
        recordCount = static_cast<std::size_t>(take("scene.recordCount"));
        roots = {static_cast<std::size_t>(take("scene.root"))};
        for (int i = 0; i < takeIfThere("scene.instances"); ++i) {
            const std::string name = entry("instances", i);
            Instance instance{};
            instance.shift = static_cast<int>(take(name + "shift"));
            instance.origin = vector(name + "origin");
            instance.root = static_cast<std::size_t>(take(name + "root"));
            instance.materialBase = static_cast<int>(take(name + "materialBase"));
            instance.box = {vector(name + "box.low"), vector(name + "box.high")};
            for (int row = 0; row < 3; ++row) {
                instance.matrix[row] = vector(name + "matrix[" + std::to_string(row) + "]");
                instance.normal[row] = vector(name + "normal[" + std::to_string(row) + "]");
            }
            instances.push_back(instance);
        }
        if (!instances.empty()) roots.clear();
        for (const Instance& instance : instances) roots.push_back(instance.root);
        hasColours = takeIfThere("scene.hasColours") != 0;
        watchdogCycles = static_cast<std::uint64_t>(takeIfThere("frame.watchdogCycles"));
        gather.bounces = static_cast<int>(takeIfThere("gather.bounces"));
        gather.parallax = static_cast<int>(takeIfThere("gather.parallax"));
        for (std::size_t i = 0; i < gather.points.size(); ++i) {
            const std::string name = entry("gather.points", static_cast<int>(i));
            gather.points[i] = {static_cast<std::uint8_t>(takeIfThere(name + "u")),
                                static_cast<std::uint8_t>(takeIfThere(name + "v"))};
        }
        hasEnvironment = takeIfThere("environment.enabled") != 0;
        if (!hasEnvironment) return;
        for (int row = 0; row < 3; ++row) {
            environment.matrix[row] = vector("environment.matrix[" + std::to_string(row) + "]");
            environment.rotation[row] = vector("environment.rotation[" + std::to_string(row) + "]");
        }
        environment.offset = vector("environment.offset");
        environment.offsetShift = static_cast<int>(take("environment.offsetShift"));
        environment.exponent = static_cast<int>(take("environment.exponent"));
        environment.boundingPlanes = static_cast<int>(take("environment.boundingPlanes"));
        environment.step = {take("environment.stepX"), take("environment.stepY")};
        environment.window = {take("environment.window.x0"), take("environment.window.y0"),
                              take("environment.window.x1"), take("environment.window.y1")};
        environment.occlusion = take("environment.occlusion") != 0;
        environment.occlusionTolerance = take("environment.occlusionTolerance");
        environment.isMapCamera = take("environment.isMapCamera") != 0;
    }

    /// Records of a leaf.
    std::size_t leafRecords() const { return hasColours ? 2 : 1; }

    /// Name prefix of a table entry's registers.
    static std::string entry(const std::string& table, int index) { return table + "[" + std::to_string(index) + "]."; }

    bool maySeeObject(std::int64_t px, std::int64_t py) const {
        const auto& rectangle = objectRectangle;
        if (px < rectangle[0] || px >= rectangle[2] || py < rectangle[1] || py >= rectangle[3]) return false;
        return std::all_of(objectOutline.begin(), objectOutline.end(),
                           [&](const HalfPlane& edge) { return edge.x * px + edge.y * py + edge.offset >= 0; });
    }
};

} // namespace colonnade
