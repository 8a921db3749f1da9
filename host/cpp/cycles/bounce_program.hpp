// shading/BounceProgram.scala: how long bounces of each kind take.
#pragma once
#include <algorithm>
#include <array>

#include "common.hpp"

namespace colonnade::cycles {

/// Cycles from a hit's request to its result, of shading/BounceUnit.scala with the smooth normal it starts with.
struct BounceCycles {
    Cycle mirror, totalReflection, glassFromBehind, glassFromFront;
};

/// The program's steps, by the names of the Scala source. A step takes a cycle, or one for each digit if it multiplies.
class BounceProgram {
public:
    /// `rootBits` and `gridBits`: of the manifest; `radicandBits`, `cosineFraction`: of the root and of the quotient.
    BounceProgram(int gridBits, int rootBits, int radicandBits, int cosineFraction)
        : rootCycles_((radicandBits + 1) / 2 + 1), quotientCycles_(cosineFraction + 2) {
        cycles_.fill(1);
        const int longDigits = (std::max({gridBits - 1, rootBits + 1, digits * digitBits}) + digitBits - 1) / digitBits;
        for (const int first : {squareNormal, dotNormalRay, squareRay, hemisphereCheck, squareAgain, dotAgain})
            multiply(first, 3, digits);
        for (const int first : {reflect, refract}) multiply(first, 6, digits);
        for (const int step : {squaredLengths, squaredCosine, etaSquared, etaCosine, etaNormal, normProduct})
            multiply(step, 1, digits);
        multiply(etaTerm, 1, longDigits);
        for (int axis = 0; axis < 3; ++axis) multiply(scaleOffset + 2 * axis, 1, longDigits);
        for (int power = 0; power < 4; ++power) multiply(powers + 2 * power, 1, digits);
    }

    /// Of a cosine whose quotient need not be shifted, so at least half; each halving takes a cycle more.
    BounceCycles cycles() const {
        const Cycle request = 1, check = from(hemisphereCheck, checkHemisphere);
        // A mirror's jump leaves the discriminant's first product, in the same step, without its second digit
        const Cycle reflection = from(0, shiftInReflection) - (digits - 1);
        // Steps that wait for root and quotient have begun before
        const Cycle root = std::max<Cycle>(0, rootCycles_ - from(startRoot, subtractRoot - 1));
        const Cycle cosine = rootCycles_ + quotientCycles_ - from(cosineRoot, quotient - 1);
        const Cycle behind = request + from(0, shiftInOrigin) + root;
        return {request + reflection + check, request + from(0, checkTotal) + check, behind,
                behind + from(squareAgain, last) + cosine};
    }

private:
    // Three products of a vector, or two for each axis of a direction; a sum is ready two steps after its last product
    static constexpr int sumLatency = 2, digits = 2, digitBits = 11;
    static constexpr int squareNormal = 0, dotNormalRay = squareNormal + 3, latchCosine = dotNormalRay + 2 + sumLatency,
                         squareRay = latchCosine + 1;
    static constexpr int reflect = squareRay + 3, shiftInReflection = reflect + 5 + sumLatency;
    static constexpr int squaredLengths = reflect + 6, squaredCosine = squaredLengths + 1,
                         etaSquared = squaredCosine + 1;
    static constexpr int squaredSine = squaredCosine + sumLatency + 3, etaTerm = squaredSine + 1,
                         checkTotal = etaTerm + sumLatency;
    static constexpr int startRoot = checkTotal + 3, etaCosine = startRoot + 1, etaNormal = etaCosine + 1,
                         subtractRoot = etaNormal + 2;
    static constexpr int refract = subtractRoot + 2, hemisphereCheck = refract + 6 + sumLatency,
                         checkHemisphere = hemisphereCheck + 2 + sumLatency;
    static constexpr int scaleOffset = checkHemisphere + 1, shiftInOrigin = scaleOffset + 4 + sumLatency;
    static constexpr int squareAgain = shiftInOrigin + 1, dotAgain = squareAgain + 3, normProduct = dotAgain + 3;
    static constexpr int cosineRoot = normProduct + 1, divide = cosineRoot + 1, quotient = divide + 1,
                         oneMinus = quotient + 2;
    static constexpr int powers = oneMinus + 1, last = powers + 7;

    void multiply(int first, int count, int digitsOfEach) { std::fill_n(cycles_.begin() + first, count, digitsOfEach); }
    Cycle from(int first, int end) const {
        Cycle sum = 0;
        for (int step = first; step <= end; ++step) sum += cycles_[static_cast<std::size_t>(step)];
        return sum;
    }

    Cycle rootCycles_, quotientCycles_;
    std::array<int, last + 1> cycles_;
};

} // namespace colonnade::cycles
