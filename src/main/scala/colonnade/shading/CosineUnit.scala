package colonnade.shading

import chisel3._
import chisel3.util.{is, log2Ceil, switch, Cat, Decoupled}
import colonnade.config.NumberFormats
import colonnade.numbers.{Divider, Rounding, SquareRoot}

/** How bright a light is on a surface. */
final class Brightness(numbers: NumberFormats) extends Bundle {

  /** `cosineFraction` fraction bits, from 0 to 1. */
  val cosine = UInt(new ShaderFormats(numbers).cosineBits.W)

  /** See [[Falloff]]; meaningless where the cosine is 0. */
  val falloff = Falloff()
}

final class CosineUnitIO(numbers: NumberFormats) extends Bundle {
  private val formats = new ShaderFormats(numbers)

  /** Both are taken with `angle`. */
  val angle      = Flipped(Decoupled(new Angle(formats)))
  val falloff    = Input(new FalloffQuestion(numbers))
  val brightness = Decoupled(new Brightness(numbers))
}

private object CosineStep extends ChiselEnum {
  val idle, root, quotient, scale, fall, fallen, scaleFalloff, done = Value
}

/** The cosine of an angle: its dot product by the root of the product of both lengths' squares; and the falloff of the
  * light that comes from there; docs/numbers.md, 5.7 and 5.8.
  *
  * One angle at a time, the divider's and the square root's latencies one after the other and four cycles more, and as
  * many as the quotient's shift by steps of four and one takes; a second division for a light with a falloff. An angle
  * that is not acute has the cosine 0, at once.
  */
final class CosineUnit(numbers: NumberFormats) extends Module {
  private val formats  = new ShaderFormats(numbers)
  private val rootBits = SquareRoot.rootBits(numbers.radicandBits)

  val io = IO(new CosineUnitIO(numbers))

  private val squareRoot = Module(new SquareRoot(numbers.radicandBits))
  private val divider    = Module(new Divider(numbers.mantissaBits, numbers.cosineFraction))

  private val step = RegInit(CosineStep.idle)
  private val dot  = Reg(UInt(formats.dotBits.W))

  /** Twice the quotient. */
  private val cosine = Reg(UInt((numbers.cosineFraction + 2).W))

  /** Two more than the bits by which [[cosine]] has to move down. */
  private val drop = Reg(UInt(log2Ceil(formats.dotBits + 4).W))

  // The falloff's quotient, moved up so that what is left is to move it down by `fall`
  private val room    = (NumberFormats.lightFraction + 3 - numbers.cosineFraction).max(0)
  private val reach   = Reg(chiselTypeOf(io.falloff.reach))
  private val square  = Reg(chiselTypeOf(io.falloff.mantissa))
  private val falloff = Reg(UInt((numbers.cosineFraction + 1 + room).max(Falloff.bits).W))
  private val fall    = Reg(SInt((formats.falloffExponentBits + 1).W))
  private val isNear  = fall < 0.S

  // The radicand: the product's top bit or the next one is set, and the exponent is made even
  private val angle    = io.angle.bits
  private val isLong   = angle.lengths(formats.lengthsBits - 1)
  private val aligned  = Mux(isLong, angle.lengths, Cat(angle.lengths(formats.lengthsBits - 2, 0), 0.U(1.W)))
  private val mantissa = Rounding.floor(aligned, formats.lengthsBits - numbers.radicandBits)
  private val exponent = angle.exponent +& isLong

  // The dot product moves up until its top bit is set, while the root is on its way
  private val isHigh = dot(formats.dotBits - 1)
  private val isLow  = !dot(formats.dotBits - 1, formats.dotBits - 4).orR

  switch(step) {
    is(CosineStep.idle) {
      dot    := angle.dot
      drop   := exponent(3, 1)
      cosine := 0.U
      reach  := io.falloff.reach
      square := io.falloff.mantissa
      fall   := (numbers.cosineFraction - NumberFormats.lightFraction + room).S -& io.falloff.exponent
      when(io.angle.fire)(step := Mux(angle.isAcute, CosineStep.root, CosineStep.done))
    }
    is(CosineStep.root) {
      when(!isHigh) {
        dot  := Mux(isLow, (dot << 4)(formats.dotBits - 1, 0), (dot << 1)(formats.dotBits - 1, 0))
        drop := drop + Mux(isLow, 4.U, 1.U)
      }
      when(divider.io.division.fire)(step := CosineStep.quotient)
    }
    is(CosineStep.quotient) {
      cosine := Cat(divider.io.quotient.bits, 0.U(1.W))
      when(divider.io.quotient.fire)(step := CosineStep.scale)
    }
    is(CosineStep.scale) {
      falloff := Falloff.one
      when(drop >= 6.U) {
        drop   := drop - 4.U
        cosine := cosine >> 4
      }.elsewhen(drop > 2.U) {
        drop   := drop - 1.U
        cosine := cosine >> 1
      }.otherwise {
        step := Mux(reach === 0.U || cosine === 0.U, CosineStep.done, CosineStep.fall)
      }
    }
    is(CosineStep.fall) {
      when(divider.io.division.fire)(step := CosineStep.fallen)
    }
    is(CosineStep.fallen) {
      falloff := divider.io.quotient.bits << room
      when(divider.io.quotient.fire)(step := CosineStep.scaleFalloff)
    }
    is(CosineStep.scaleFalloff) {
      when(isNear) {
        falloff := Falloff.most
        step    := CosineStep.done
      }.elsewhen(fall >= 4.S && falloff =/= 0.U) {
        fall    := fall - 4.S
        falloff := falloff >> 4
      }.elsewhen(fall > 0.S && falloff =/= 0.U) {
        fall    := fall - 1.S
        falloff := falloff >> 1
      }.otherwise {
        falloff := Mux(falloff > Falloff.most, Falloff.most, falloff)
        step    := CosineStep.done
      }
    }
    is(CosineStep.done) {
      when(io.brightness.fire)(step := CosineStep.idle)
    }
  }

  io.angle.ready               := step === CosineStep.idle && squareRoot.io.radicand.ready
  squareRoot.io.radicand.valid := io.angle.valid && step === CosineStep.idle && angle.isAcute
  squareRoot.io.radicand.bits  := Mux(exponent(0), mantissa, mantissa >> 1)

  private val divides = step === CosineStep.root && isHigh
  squareRoot.io.root.ready := divides && divider.io.division.ready
  private val isFalloff = step === CosineStep.fall
  divider.io.division.valid          := isFalloff || (divides && squareRoot.io.root.valid)
  divider.io.division.bits.numerator :=
    Mux(isFalloff, reach, Rounding.floor(dot, formats.dotBits - numbers.mantissaBits))
  divider.io.division.bits.denominator := Mux(
    isFalloff,
    Rounding.floor(square, formats.shadeBits - numbers.mantissaBits),
    Rounding.floor(squareRoot.io.root.bits, rootBits - numbers.mantissaBits)
  )
  divider.io.quotient.ready := step === CosineStep.quotient || step === CosineStep.fallen

  private val one = 1.U << numbers.cosineFraction
  io.brightness.valid       := step === CosineStep.done
  io.brightness.bits.cosine :=
    Mux(cosine(numbers.cosineFraction + 1, numbers.cosineFraction).orR, one, cosine)
  io.brightness.bits.falloff := falloff
}
