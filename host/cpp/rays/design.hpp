// A design as text: lines "number NAME VALUE" and "layout RECORD FIELD OFFSET WIDTH SIGNED" of its manifest.
#pragma once
#include <sstream>

#include "packer/records.hpp"

namespace colonnade::rays {

struct Design {
    std::map<std::string, std::int64_t> numbers;
    packer::RecordFormat format;

    /// Throws std::invalid_argument for a line that is none, or a value that is missing.
    explicit Design(const std::string& text) {
        std::istringstream lines(text);
        std::string kind, record, name;
        while (lines >> kind) {
            if (kind == "number") {
                std::int64_t value = 0;
                lines >> name >> value;
                numbers[name] = value;
            } else if (kind == "layout") {
                Field field{};
                lines >> record >> name >> field.offset >> field.width >> field.isSigned;
                format.layouts[record][name] = field;
            } else throw std::invalid_argument("the design has a line of the unknown kind '" + kind + "'");
            if (!lines) throw std::invalid_argument("the design has a line that is not complete: " + kind + " " + name);
        }
        for (const char* each : {"node", "nearPair", "triangle", "flatPair", "farPair"})
            if (!format.layouts.count(each)) throw std::invalid_argument("the design has no layout of '" + std::string(each) + "'");
        format.recordBits = number("recordBits");
        format.vertexBits = number("vertexBits");
        format.boxBits = number("boxBits");
        format.stackDepth = number("stackDepth");
        format.normalFraction = number("normalFraction");
        format.bvh = number("bvh") != 0;
    }

    int number(const char* name) const { return static_cast<int>(lookUp(numbers, name)); }
};

} // namespace colonnade::rays
