package colonnade.shading

import chisel3._
import chisel3.util.{is, log2Ceil, switch, Cat, Decoupled}
import colonnade.config.NumberFormats
import colonnade.numbers.{Divider, Rounding, SquareRoot}

/** The brightness of a light on a surface. */
final class Brightness(numbers: NumberFormats) extends Bundle {
  val cosine  = UInt(new ShaderFormats(numbers).cosineBits.W) // `cosineFraction` fraction bits, from 0 to 1
  val falloff = Falloff()                                     // see Falloff; 1 if the cosine is 0
}

final class CosineUnitIO(numbers: NumberFormats) extends Bundle {
  private val formats = new ShaderFormats(numbers)

  val angle      = Flipped(Decoupled(new Angle(formats)))
  val falloff    = Input(new FalloffRequest(numbers)) // taken together with `angle`
  val brightness = Decoupled(new Brightness(numbers))
}

private object CosineStep extends ChiselEnum {
  val idle, root, quotient, shiftCosine, divideFalloff, falloffQuotient, shiftFalloff, done = Value
}

/** The cosine of an angle, and the light's falloff: docs/numbers.md, 5.7 and 5.8. The cosine is the dot product divided
  * by the root of the product of both squared lengths.
  *
  * One angle at a time. Latency: square root, division, four cycles, and the quotient's shift in steps of four bits and
  * one bit; a second division for a light with a falloff. The cosine of an angle that is not acute is 0 at once.
  */
final class CosineUnit(numbers: NumberFormats) extends Module {
  private val formats  = new ShaderFormats(numbers)
  private val rootBits = SquareRoot.rootBits(numbers.radicandBits)

  val io = IO(new CosineUnitIO(numbers))

  private val squareRoot = Module(new SquareRoot(numbers.radicandBits))
  private val divider    = Module(new Divider(numbers.mantissaBits, numbers.cosineFraction))

  private val step       = RegInit(CosineStep.idle)
  private val dot        = Reg(UInt(formats.dotBits.W))
  private val cosine     = Reg(UInt((numbers.cosineFraction + 2).W))  // twice the quotient
  private val shiftRight = Reg(UInt(log2Ceil(formats.dotBits + 4).W)) // two more than the bits that `cosine` moves down

  // The falloff's quotient has guard bits below, so that it only has to move down, by `falloffShift`
  private val guardBits    = (NumberFormats.lightFraction + 3 - numbers.cosineFraction).max(0)
  private val reference    = Reg(chiselTypeOf(io.falloff.reference))
  private val square       = Reg(chiselTypeOf(io.falloff.mantissa))
  private val falloff      = Reg(UInt((numbers.cosineFraction + 1 + guardBits).max(Falloff.bits).W))
  private val falloffShift = Reg(SInt((formats.falloffExponentBits + 1).W))
  private val isNear       = falloffShift < 0.S

  // The radicand: one of the product's two top bits is set, and the exponent is made even
  private val angle   = io.angle.bits
  private val isLong  = angle.normProduct(formats.normProductBits - 1)
  private val aligned = Mux(isLong, angle.normProduct, Cat(angle.normProduct(formats.normProductBits - 2, 0), 0.U(1.W)))
  private val mantissa = Rounding.floor(aligned, formats.normProductBits - numbers.radicandBits)
  private val exponent = angle.exponent +& isLong

  // While the root is computed, the dot product moves up until its top bit is set
  private val isHigh = dot(formats.dotBits - 1)
  private val isLow  = !dot(formats.dotBits - 1, formats.dotBits - 4).orR

  switch(step) {
    is(CosineStep.idle) {
      dot          := angle.dot
      shiftRight   := exponent(3, 1)
      cosine       := 0.U
      falloff      := Falloff.one
      reference    := io.falloff.reference
      square       := io.falloff.mantissa
      falloffShift := (numbers.cosineFraction - NumberFormats.lightFraction + guardBits).S -& io.falloff.exponent
      when(io.angle.fire)(step := Mux(angle.isAcute, CosineStep.root, CosineStep.done))
    }
    is(CosineStep.root) {
      when(!isHigh) {
        dot        := Mux(isLow, (dot << 4)(formats.dotBits - 1, 0), (dot << 1)(formats.dotBits - 1, 0))
        shiftRight := shiftRight + Mux(isLow, 4.U, 1.U)
      }
      when(divider.io.division.fire)(step := CosineStep.quotient)
    }
    is(CosineStep.quotient) {
      cosine := Cat(divider.io.quotient.bits, 0.U(1.W))
      when(divider.io.quotient.fire)(step := CosineStep.shiftCosine)
    }
    is(CosineStep.shiftCosine) {
      when(shiftRight >= 6.U) {
        shiftRight := shiftRight - 4.U
        cosine     := cosine >> 4
      }.elsewhen(shiftRight > 2.U) {
        shiftRight := shiftRight - 1.U
        cosine     := cosine >> 1
      }.otherwise {
        step := Mux(reference === 0.U || cosine === 0.U, CosineStep.done, CosineStep.divideFalloff)
      }
    }
    is(CosineStep.divideFalloff) { when(divider.io.division.fire)(step := CosineStep.falloffQuotient) }
    is(CosineStep.falloffQuotient) {
      falloff := divider.io.quotient.bits << guardBits
      when(divider.io.quotient.fire)(step := CosineStep.shiftFalloff)
    }
    is(CosineStep.shiftFalloff) {
      when(isNear) {
        falloff := Falloff.max
        step    := CosineStep.done
      }.elsewhen(falloffShift >= 4.S && falloff =/= 0.U) {
        falloffShift := falloffShift - 4.S
        falloff      := falloff >> 4
      }.elsewhen(falloffShift > 0.S && falloff =/= 0.U) {
        falloffShift := falloffShift - 1.S
        falloff      := falloff >> 1
      }.otherwise {
        falloff := Mux(falloff > Falloff.max, Falloff.max, falloff)
        step    := CosineStep.done
      }
    }
    is(CosineStep.done) { when(io.brightness.fire)(step := CosineStep.idle) }
  }

  // The root is taken before the next angle comes: its own `ready` would add a path from the divider to the geometry
  io.angle.ready := step === CosineStep.idle
  assert(step =/= CosineStep.idle || squareRoot.io.radicand.ready, "a root is computed while no angle is")
  squareRoot.io.radicand.valid := io.angle.valid && step === CosineStep.idle && angle.isAcute
  squareRoot.io.radicand.bits  := Mux(exponent(0), mantissa, mantissa >> 1)

  private val divides = step === CosineStep.root && isHigh
  squareRoot.io.root.ready := divides && divider.io.division.ready
  private val isFalloff = step === CosineStep.divideFalloff
  divider.io.division.valid          := isFalloff || (divides && squareRoot.io.root.valid)
  divider.io.division.bits.numerator :=
    Mux(isFalloff, reference, Rounding.floor(dot, formats.dotBits - numbers.mantissaBits))
  divider.io.division.bits.denominator := Mux(
    isFalloff,
    Rounding.floor(square, formats.shadeBits - numbers.mantissaBits),
    Rounding.floor(squareRoot.io.root.bits, rootBits - numbers.mantissaBits)
  )
  divider.io.quotient.ready := step === CosineStep.quotient || step === CosineStep.falloffQuotient

  private val one = 1.U << numbers.cosineFraction
  io.brightness.valid        := step === CosineStep.done
  io.brightness.bits.cosine  := Mux(cosine(numbers.cosineFraction + 1, numbers.cosineFraction).orR, one, cosine)
  io.brightness.bits.falloff := falloff
}
