// Expected values for the RTL's specs: reads one question a line from standard input, answers each with one line of integers.
//
//   numbers key=value ...                                   (first line; no answer)
//   setup  isShadow origin[3] direction[3] low[3] high[3] -> enters axis negative[3] origin[3] boxOrigin[3] shear[2] reciprocal[2] exponent[2] entry limit
//   box    axis negative[3] boxOrigin[3] reciprocal[2] exponent[2] limit, origin[3] exponent[3] firstChild firstTriangles (kind low[3] high[3])*arity
//                                                         -> tests count (slot near)*count
//   triangle axis negative[3] origin[3] shear[2] vertices[9] -> isHit t weights[3] backSide
//   limit  t                                              -> limitUnits
//   shade  axis negative[3] origin[3] shear[2] t weights[3] backSide normals[9] geometricNormal[3] offset flat shadows
//          count, count * (position[3] colour[3] reachMantissa reachExponent)
//                                                         -> origin[3], count * (direct[3] needsShadowRay)
//   lightenvironment point[3] normal[3] offset shadows count, count * (position[3] colour[3] reachMantissa reachExponent)
//                                                         -> as shade, for a point of a room
//   bounce axis negative[3] origin[3] shear[2] t weights[3] backSide normals[9] geometricNormal[3] offset flat kind etaFront etaBack reflectance
//                                                         -> isRefraction origin[3] direction[3] reflection[3] share
//
// Whole pixels; the first three lines have no answer, and set the scene in this order:
//   layout record name=offset,width,signed ...              (once for each kind of record)
//   records triangleBase attributeBase hexadecimal ...
//   registers name=value ...
//   pixel  x y                                            -> colour[3] isObject triangle distance ratio[3]
//          in a room, if its lines stand before the registers
//
// Rooms: see room_questions.hpp.
#include <optional>
#include <sstream>

#include "model/frame.hpp"
#include "environment_questions.hpp"

namespace {

using namespace colonnade;

void askHeading(Question& ask, Ray& ray) {
    ray.enters = true;
    ray.axis = static_cast<int>(ask.number());
    for (auto& sign : ray.negative) sign = ask.number() != 0;
}

Ray askTriangleRay(Question& ask) {
    Ray ray{};
    askHeading(ask, ray);
    ray.origin = ask.vector();
    for (auto& shear : ray.shear) shear = ask.number();
    return ray;
}

void answerSetUp(Question& ask, const Numbers& n) {
    const bool isShadow = ask.number() != 0;
    RayRequest request{ask.wideVector(), {}, 0, 0};
    request.direction = ask.wideVector();
    request.limit = isShadow ? static_cast<Wide>(magnitude(request.direction[dominantAxis(request.direction)])) : n.unlimited();
    Bounds bounds{ask.vector(), {}};
    bounds.high = ask.vector();
    const Ray ray = prepareRay(request, bounds, n);
    Answer answer;
    answer << ray.enters << ray.axis;
    answer.all(ray.negative).all(ray.origin).all(ray.boxOrigin).all(ray.shear).all(ray.reciprocal).all(ray.exponent);
    answer << ray.entry << ray.limit;
    answer.print();
}

void answerBox(Question& ask, const Numbers& n) {
    Ray ray{};
    askHeading(ask, ray);
    ray.boxOrigin = ask.vector();
    for (auto& reciprocal : ray.reciprocal) reciprocal = ask.number();
    for (auto& exponent : ray.exponent) exponent = static_cast<int>(ask.number());
    const std::int64_t limit = ask.number();
    Node node{};
    node.origin = ask.vector();
    for (auto& exponent : node.exponent) exponent = static_cast<int>(ask.number());
    node.firstChild = static_cast<std::uint32_t>(ask.number());
    node.firstTriangles = static_cast<std::uint32_t>(ask.number());
    for (int child = 0; child < n.arity; ++child) {
        node.kinds[child] = static_cast<Child>(ask.number());
        for (auto& low : node.low[child]) low = static_cast<std::int32_t>(ask.number());
        for (auto& high : node.high[child]) high = static_cast<std::int32_t>(ask.number());
    }
    std::array<Entered, 4> entered;
    std::uint64_t tests = 0;
    const int count = testBoxes(ray, node, limit, n, entered, tests);
    Answer answer;
    answer << static_cast<Wide>(tests) << count;
    for (int i = 0; i < count; ++i) answer << entered[i].slot << entered[i].near;
    answer.print();
}

void answerTriangle(Question& ask, const Numbers& n) {
    const Ray ray = askTriangleRay(ask);
    std::array<Vector, 3> vertices;
    for (auto& vertex : vertices) vertex = ask.vector();
    Hit hit{false, n.farthest(), ~std::uint64_t(0), {}, false};
    testTriangle(ray, vertices, 0, n, hit);
    Answer answer;
    answer << hit.found << (hit.found ? hit.t : 0);
    answer.all(hit.weights) << hit.backSide;
    answer.print();
}

Surface askSurface(Question& ask, const Numbers& n) {
    const Ray ray = askTriangleRay(ask);
    Hit hit{true, ask.number(), 0, {}, false};
    for (auto& weight : hit.weights) weight = ask.number();
    hit.backSide = ask.number() != 0;
    Face face{};
    for (auto& normal : face.normals) normal = ask.vector();
    face.geometricNormal = ask.vector();
    return surfaceOf(ray, hit, face, n);
}

/// What the lights give to a surface that a question goes on about.
void answerLights(Question& ask, const WideVector& origin, const WideVector& normal, bool shadows, const Numbers& n) {
    Answer answer;
    answer.all(origin);
    for (std::int64_t left = ask.number(); left > 0; --left) {
        Light light{ask.wideVector(), {}, 0, 0};
        light.colour = ask.vector();
        light.reachMantissa = ask.number();
        light.reachExponent = static_cast<int>(ask.number());
        const Illumination illumination = illuminate(origin, normal, light, shadows, n);
        answer.all(illumination.direct) << illumination.needsShadowRay;
    }
    answer.print();
}

void answerShade(Question& ask, const Numbers& n) {
    const Surface surface = askSurface(ask, n);
    const std::int64_t offset = ask.number();
    const bool flat = ask.number() != 0, shadows = ask.number() != 0;
    const WideVector origin = offSurface(surface.point, surface.faceForwardNormal, offset, n);
    answerLights(ask, origin, shadingNormal(surface, flat), shadows, n);
}

void answerLightEnvironment(Question& ask, const Numbers& n) {
    const WideVector point = ask.wideVector();
    const Vector normal = ask.vector();
    const WideVector origin = offSurface(point, normal, ask.number(), n);
    const bool shadows = ask.number() != 0;
    answerLights(ask, origin, {normal[0], normal[1], normal[2]}, shadows, n);
}

void answerBounce(Question& ask, const Numbers& n) {
    const Surface surface = askSurface(ask, n);
    const std::int64_t offset = ask.number();
    const bool flat = ask.number() != 0;
    Material material{{}, static_cast<MaterialKind>(ask.number()), {}, 0};
    for (auto& eta : material.eta) eta = ask.number();
    material.reflectance = ask.number();
    const Bounce next = bounce(surface, material, flat, offset, n);
    Answer answer;
    answer << next.isRefraction;
    answer.all(next.ray.origin).all(next.ray.direction).all(next.reflection) << next.share;
    answer.print();
}

std::map<std::string, std::int64_t> readNumbers(std::istream& words) {
    std::map<std::string, std::int64_t> values;
    for (std::string pair; words >> pair;) {
        const auto equals = pair.find('=');
        values[pair.substr(0, equals)] = std::stoll(pair.substr(equals + 1));
    }
    return values;
}

/// A device with a scene in it.
class Scene {
public:
    explicit Scene(const Numbers& numbers) : numbers_(numbers) {}

    void readLayout(std::istream& words) {
        std::string record;
        words >> record;
        for (std::string field; words >> field;) {
            const auto equals = field.find('=');
            std::istringstream place(field.substr(equals + 1));
            char comma;
            Field& read = layouts_[record][field.substr(0, equals)];
            place >> read.offset >> comma >> read.width >> comma >> read.isSigned;
        }
    }

    const std::map<std::string, Layout>& layouts() const { return layouts_; }

    void readRecords(std::istream& words) {
        std::size_t triangleBase, attributeBase, count = 0;
        words >> triangleBase >> attributeBase;
        std::vector<std::uint8_t> bytes;
        for (std::string digits; words >> digits; ++count)
            for (std::size_t end = digits.size(); end > 0; end -= 2) bytes.push_back(static_cast<std::uint8_t>(std::stoi(digits.substr(end - 2, 2), nullptr, 16)));
        if (count == 0) throw std::invalid_argument("a scene without records");
        device_.emplace(numbers_, layouts_);
        device_->load(bytes.data(), count, bytes.size() / count);
    }

    Device& device() {
        if (!device_) throw std::invalid_argument("there is no scene yet");
        return *device_;
    }

private:
    Numbers numbers_;
    std::map<std::string, Layout> layouts_;
    std::optional<Device> device_;
};

void answerPixel(Question& ask, Device& device) {
    const std::int64_t x = ask.number(), y = ask.number();
    const Pixel pixel = device.render(x, y);
    Answer answer;
    answer.all(pixel.colour) << pixel.isObject << pixel.triangle << pixel.distance;
    answer.all(pixel.ratio).print();
}

} // namespace

int main() try {
    std::string line, kind;
    std::getline(std::cin, line);
    std::istringstream first(line);
    first >> kind;
    const Numbers numbers(readNumbers(first));
    Scene scene(numbers);
    Room environment;
    while (std::getline(std::cin, line)) {
        std::istringstream words(line);
        words >> kind;
        Question ask(words);
        if (kind == "setup") answerSetUp(ask, numbers);
        else if (kind == "box") answerBox(ask, numbers);
        else if (kind == "triangle") answerTriangle(ask, numbers);
        else if (kind == "shade") answerShade(ask, numbers);
        else if (kind == "lightenvironment") answerLightEnvironment(ask, numbers);
        else if (kind == "bounce") answerBounce(ask, numbers);
        else if (kind == "layout") scene.readLayout(words);
        else if (kind == "records") scene.readRecords(words);
        else if (kind == "registers") {
            if (environment.maps()) scene.device().load(*environment.maps());
            scene.device().start(readNumbers(words));
        }
        else if (kind == "pixel") answerPixel(ask, scene.device());
        else if (kind == "sizes") environment.begin(readNumbers(words), scene.layouts());
        else if (kind == "words") environment.load(words);
        else if (environment.knows(kind)) environment.answer(kind, ask, numbers).print();
        else if (kind == "limit") (Answer() << limitUnits(ask.number(), numbers)).print();
        else throw std::invalid_argument("unknown question '" + kind + "'");
    }
    return 0;
} catch (const std::exception& problem) {
    std::cerr << "vectors: " << problem.what() << '\n';
    return 2;
}
