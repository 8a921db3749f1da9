// Expected values for the RTL specs: replies to each query, a line on standard input, with a line of integers.
//
//   numbers key=value ...                                   (first line; no reply)
//   setup  isShadow origin[3] direction[3] low[3] high[3] -> enters axis negative[3] origin[3] boxOrigin[3] shear[2]
//       reciprocal[2] exponent[2] entry limit
//   box    axis negative[3] boxOrigin[3] reciprocal[2] exponent[2] limit, origin[3] exponent[3] nodes leaves (low[3]
//          high[3])*4
//                                                         -> tests count (slot near)*count
//   triangle axis negative[3] origin[3] shear[2] vertices[9] -> isHit t weights[3] backSide
//   limit  t                                              -> tMaxUnits
//   closest tMax count (t id)*count                       -> isHit t id, of the hits of a ray
//   shade  axis negative[3] origin[3] shear[2] t weights[3] backSide normals[9] geometricNormal[3] offset flat
//          shadows
//          count, count * (position[3] colour[3] reachMantissa reachExponent)
//                                                         -> origin[3], count * (direct[3] needsShadowRay)
//   cornercolour weights[3] colours[9]                    -> colour[3]
//   lightenvironment point[3] normal[3] offset shadows count, count * (position[3] colour[3] reachMantissa
//       reachExponent)
//                                                         -> as shade, for a point of the environment
//   bounce axis negative[3] origin[3] shear[2] t weights[3] backSide normals[9] geometricNormal[3] offset flat kind
//       etaFront etaBack reflectance
//                                                         -> isRefraction origin[3] direction[3] reflection[3]
//                                                            fresnelWeight
//   cornernormal u v                                      -> normal[3]
//   geometricnormal vertices[9]                           -> normal[3]
//   leaf   words[n], n = 8 up to 19 vertex bits, 32 bits each, low ones first         -> format isClear material
//       vertices[4][3] normals[4][2]; missing ones are 0
//   leafface triangle words[n]                            -> material normals[9] geometricNormal[3]
//   newleaf isPair isClear material vertices[4][3] normals[4][2]
//                                                         -> words[n]; all 0 if the vertices are too far apart
//          after `layout` lines of the formats of leaves
//
// Queries for whole pixels. The first three lines load the scene, in this order, and have no reply:
//   layout record name=offset,width,signed ...              (for each kind of record)
//   records hexadecimal ...
//   registers name=value ...
//   pixel  x y                                            -> colour[3] isObject triangle distance ratio[3]
//          with an environment if its lines precede the registers
//
// Environment maps: see environment_queries.hpp; instances: see instance_queries.hpp; rays of applications: see
// ray_queries.hpp.
#include <optional>
#include <sstream>

#include "model/frame.hpp"
#include "packer/leaf.hpp"
#include "environment_queries.hpp"
#include "instance_queries.hpp"
#include "ray_queries.hpp"

namespace {

using namespace colonnade;

void replyRaySetup(Query& query, const Numbers& n) {
    const bool isShadow = query.number() != 0;
    RayRequest request{query.wideVector(), {}, 0};
    request.direction = query.wideVector();
    request.tMax =
        isShadow ? static_cast<Wide>(magnitude(request.direction[dominantAxis(request.direction)])) : n.unlimited();
    Bounds bounds{query.vector(), {}};
    bounds.high = query.vector();
    const Ray ray = prepareRay(request, bounds, n);
    Reply reply;
    reply << ray.enters << ray.axis;
    reply.all(ray.negative).all(ray.origin).all(ray.boxOrigin).all(ray.shear).all(ray.reciprocal).all(ray.exponent);
    reply << ray.tEntry << ray.tMax;
    reply.print();
}

void replyBox(Query& query, const Numbers& n) {
    Ray ray{};
    readOrientation(query, ray);
    ray.boxOrigin = query.vector();
    for (auto& reciprocal : ray.reciprocal) reciprocal = query.number();
    for (auto& exponent : ray.exponent) exponent = static_cast<int>(query.number());
    const std::int64_t limit = query.number();
    Node node{};
    for (auto& origin : node.origin) origin = static_cast<std::int32_t>(query.number());
    for (auto& exponent : node.exponent) exponent = static_cast<std::int8_t>(query.number());
    node.nodes = static_cast<std::uint8_t>(query.number());
    node.leaves = static_cast<std::uint8_t>(query.number());
    for (int child = 0; child < nodeChildren; ++child)
        for (auto* planes : {&node.low, &node.high})
            for (auto& axis : *planes) axis[child] = static_cast<std::uint8_t>(query.number());
    std::array<Entered, 4> entered;
    const int count = testBoxes(ray, node, limit, n, entered);
    Reply reply;
    reply << node.children() << count;
    for (int i = 0; i < count; ++i) reply << entered[i].slot << entered[i].tNear;
    reply.print();
}

void replyTriangle(Query& query, const Numbers& n) {
    const Ray ray = readTriangleRay(query);
    std::array<Vector, 3> vertices;
    for (auto& vertex : vertices) vertex = query.vector();
    Hit hit = Hit::none(n.maxT());
    testTriangle(ray, vertices, 0, n, hit);
    Reply reply;
    reply << hit.found << (hit.found ? hit.t : 0);
    reply.all(hit.weights) << hit.backSide;
    reply.print();
}

void replyClosest(Query& query) {
    Hit best = Hit::none(query.number());
    for (std::int64_t left = query.number(); left > 0; --left) {
        const std::int64_t t = query.number();
        const auto id = static_cast<std::uint64_t>(query.number());
        if (best.isReplacedBy(t, id)) best = {true, t, id, {}, false};
    }
    (Reply() << best.found << best.t << static_cast<Wide>(best.id)).print();
}

Surface readSurface(Query& query, const Numbers& n) {
    const Ray ray = readTriangleRay(query);
    Hit hit{true, query.number(), 0, {}, false};
    for (auto& weight : hit.weights) weight = query.number();
    hit.backSide = query.number() != 0;
    Face face{};
    for (auto& normal : face.normals) normal = query.vector();
    face.geometricNormal = query.vector();
    return surfaceOf(ray, hit, face, n);
}

/// Replies with the illumination of a surface by each light of the query.
void replyLights(Query& query, const WideVector& origin, const WideVector& normal, bool shadows, const Numbers& n) {
    Reply reply;
    reply.all(origin);
    for (std::int64_t left = query.number(); left > 0; --left) {
        Light light{query.wideVector(), {}, 0, 0};
        light.colour = query.vector();
        light.reachMantissa = query.number();
        light.reachExponent = static_cast<int>(query.number());
        const Illumination illumination = illuminate(origin, normal, light, shadows, n);
        reply.all(illumination.direct) << illumination.needsShadowRay;
    }
    reply.print();
}

void replyShade(Query& query, const Numbers& n) {
    const Surface surface = readSurface(query, n);
    const std::int64_t offset = query.number();
    const bool flat = query.number() != 0, shadows = query.number() != 0;
    const WideVector origin = offSurface(surface.point, surface.faceForwardNormal, offset, n);
    replyLights(query, origin, shadingNormal(surface, flat), shadows, n);
}

void replyCornerColour(Query& query, const Numbers& n) {
    Hit hit{true, 0, 0, {}, false};
    for (auto& weight : hit.weights) weight = query.number();
    Face face{};
    for (auto& colour : face.colours) colour = query.vector();
    Reply reply;
    reply.all(cornerColour(hit, face, n)).print();
}

void replyEnvironmentLight(Query& query, const Numbers& n) {
    const WideVector point = query.wideVector();
    const Vector normal = query.vector();
    const WideVector origin = offSurface(point, normal, query.number(), n);
    const bool shadows = query.number() != 0;
    replyLights(query, origin, {normal[0], normal[1], normal[2]}, shadows, n);
}

void replyCornerNormal(Query& query, const Numbers& n) {
    Octahedral code{query.number(), 0};
    code.v = query.number();
    Reply reply;
    reply.all(directionOf(code, n.normalFraction)).print();
}

void replyGeometricNormal(Query& query, const Numbers& n) {
    std::array<Vector, 3> vertices;
    for (auto& vertex : vertices) vertex = query.vector();
    Reply reply;
    reply.all(geometricNormal(vertices, n.normalFraction)).print();
}

using LeafBytes = std::vector<std::uint8_t>;

Leaf readLeaf(Query& query, const LeafFields& fields) {
    LeafBytes record(4 * fields.words());
    for (std::size_t word = 0; word < fields.words(); ++word)
        for (std::int64_t byte = 0, bits = query.number(); byte < 4; ++byte)
            record[4 * word + byte] = static_cast<std::uint8_t>(bits >> 8 * byte);
    return readLeaf(fields, record.data());
}

void replyLeaf(Query& query, const LeafFields& fields) {
    const Leaf leaf = readLeaf(query, fields);
    Reply reply;
    reply << static_cast<int>(leaf.format) << leaf.isClear << leaf.material;
    for (const auto& vertex : leaf.vertices) reply.all(vertex);
    for (const auto& normal : leaf.normals) reply << normal.u << normal.v;
    reply.print();
}

void replyLeafFace(Query& query, const LeafFields& fields, const Numbers& n) {
    const int triangle = static_cast<int>(query.number());
    const Face face = faceOf(readLeaf(query, fields), triangle, n.normalFraction);
    Reply reply;
    reply << face.material;
    for (const auto& normal : face.normals) reply.all(normal);
    reply.all(face.geometricNormal).print();
}

void replyNewLeaf(Query& query, const LeafFields& fields, const Numbers& n) {
    Leaf leaf{};
    const bool isPair = query.number() != 0;
    leaf.isClear = query.number() != 0;
    leaf.material = static_cast<int>(query.number());
    for (auto& vertex : leaf.vertices) vertex = query.vector();
    for (auto& normal : leaf.normals) {
        normal.u = query.number();
        normal.v = query.number();
    }
    const std::optional<LeafFormat> format =
        isPair ? packer::formatOf(fields, leaf, n.normalFraction) : LeafFormat::triangle;
    LeafBytes record(4 * fields.words());
    if (format) {
        leaf.format = *format;
        packer::writeLeaf(fields, leaf, record.data());
    }
    Reply reply;
    for (std::size_t word = 0; word < fields.words(); ++word) {
        std::int64_t bits = 0;
        for (std::size_t byte = 0; byte < 4; ++byte) bits |= std::int64_t(record[4 * word + byte]) << 8 * byte;
        reply << bits;
    }
    reply.print();
}

void replyBounce(Query& query, const Numbers& n) {
    const Surface surface = readSurface(query, n);
    const std::int64_t offset = query.number();
    const bool flat = query.number() != 0;
    Material material{{}, false, false, {}, static_cast<MaterialKind>(query.number()), {}, 0};
    for (auto& eta : material.eta) eta = query.number();
    material.reflectance = query.number();
    const Bounce next = bounce(surface, material, flat, offset, n);
    Reply reply;
    reply << next.isRefraction;
    reply.all(next.ray.origin).all(next.ray.direction).all(next.reflection) << next.fresnelWeight;
    reply.print();
}

std::map<std::string, std::int64_t> readNumbers(std::istream& words) {
    std::map<std::string, std::int64_t> values;
    for (std::string pair; words >> pair;) {
        const auto equals = pair.find('=');
        values[pair.substr(0, equals)] = std::stoll(pair.substr(equals + 1));
    }
    return values;
}

/// A device with a loaded scene.
class Scene {
public:
    explicit Scene(const Numbers& numbers) : numbers_(numbers) {}

    void readLayout(std::istream& words) {
        std::string record;
        words >> record;
        for (std::string field; words >> field;) {
            const auto equals = field.find('=');
            std::istringstream layout(field.substr(equals + 1));
            char comma;
            Field& read = layouts_[record][field.substr(0, equals)];
            layout >> read.offset >> comma >> read.width >> comma >> read.isSigned;
        }
    }

    const std::map<std::string, Layout>& layouts() const { return layouts_; }

    const LeafFields& leafFields() {
        if (!leafFields_) leafFields_.emplace(layouts_);
        return *leafFields_;
    }

    void readRecords(std::istream& words) {
        const auto [bytes, count] = readRecordBytes(words);
        device_.emplace(numbers_, layouts_);
        device_->load(bytes.data(), count, bytes.size() / count);
    }

    Device& device() {
        if (!device_) throw std::invalid_argument("no scene is loaded");
        return *device_;
    }

private:
    Numbers numbers_;
    std::map<std::string, Layout> layouts_;
    std::optional<LeafFields> leafFields_;
    std::optional<Device> device_;
};

void replyPixel(Query& query, Device& device) {
    const std::int64_t x = query.number(), y = query.number();
    const Pixel pixel = device.render(x, y);
    Reply reply;
    reply.all(pixel.colour) << pixel.isObject << pixel.triangle << pixel.distance;
    reply.all(pixel.ratio).print();
}

} // namespace

int main() try {
    std::string line, kind;
    std::getline(std::cin, line);
    std::istringstream first(line);
    first >> kind;
    const std::map<std::string, std::int64_t> values = readNumbers(first);
    const Numbers numbers(values);
    const auto directionBits = static_cast<int>(lookUp(values, "directionBits"));
    Scene scene(numbers);
    EnvironmentQueries environment;
    RayBatches batches;
    while (std::getline(std::cin, line)) {
        std::istringstream words(line);
        words >> kind;
        Query query(words);
        if (kind == "setup") replyRaySetup(query, numbers);
        else if (kind == "box") replyBox(query, numbers);
        else if (kind == "triangle") replyTriangle(query, numbers);
        else if (kind == "closest") replyClosest(query);
        else if (kind == "shade") replyShade(query, numbers);
        else if (kind == "cornercolour") replyCornerColour(query, numbers);
        else if (kind == "lightenvironment") replyEnvironmentLight(query, numbers);
        else if (kind == "ray") replyRay(query, numbers, directionBits);
        else if (kind == "hit") replyHit(query, numbers, directionBits);
        else if (kind == "image") batches.load(query, words, numbers, directionBits, scene.layouts());
        else if (kind == "batch") batches.reply(query);
        else if (kind == "instanceray") replyInstanceRay(query, numbers);
        else if (kind == "instancebox") replyInstanceBox(query, numbers);
        else if (kind == "instanceface") replyInstanceFace(query, numbers);
        else if (kind == "bounce") replyBounce(query, numbers);
        else if (kind == "cornernormal") replyCornerNormal(query, numbers);
        else if (kind == "geometricnormal") replyGeometricNormal(query, numbers);
        else if (kind == "leaf") replyLeaf(query, scene.leafFields());
        else if (kind == "leafface") replyLeafFace(query, scene.leafFields(), numbers);
        else if (kind == "newleaf") replyNewLeaf(query, scene.leafFields(), numbers);
        else if (kind == "layout") scene.readLayout(words);
        else if (kind == "records") scene.readRecords(words);
        else if (kind == "registers") {
            if (environment.maps()) scene.device().load(*environment.maps());
            scene.device().start(readNumbers(words));
        } else if (kind == "pixel") replyPixel(query, scene.device());
        else if (kind == "sizes") environment.begin(readNumbers(words), scene.layouts());
        else if (kind == "words") environment.load(words);
        else if (environment.knows(kind)) environment.reply(kind, query, numbers).print();
        else if (kind == "limit") (Reply() << tMaxUnits(query.number(), numbers)).print();
        else throw std::invalid_argument("unknown query '" + kind + "'");
    }
    return 0;
} catch (const std::exception& problem) {
    std::cerr << "vectors: " << problem.what() << '\n';
    return 2;
}
