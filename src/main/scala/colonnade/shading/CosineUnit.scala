package colonnade.shading

import chisel3._
import chisel3.util.{is, log2Ceil, switch, Cat, Decoupled}
import colonnade.config.NumberFormats
import colonnade.numbers.{Divider, Rounding, SquareRoot}

final class CosineUnitIO(numbers: NumberFormats) extends Bundle {
  private val formats = new ShaderFormats(numbers)

  val angle = Flipped(Decoupled(new Angle(formats)))

  /** `cosineFraction` fraction bits, from 0 to 1. */
  val cosine = Decoupled(UInt(formats.cosineBits.W))
}

private object CosineStep extends ChiselEnum {
  val idle, root, quotient, scale = Value
}

/** The cosine of an angle: its dot product by the root of the product of both lengths' squares; docs/numbers.md, 5.7.
  *
  * One angle at a time, the divider's and the square root's latencies one after the other and three cycles more, and as
  * many as the quotient's shift by steps of four and one takes. An angle that is not acute has the cosine 0, at once.
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
      when(io.angle.fire)(step := Mux(angle.isAcute, CosineStep.root, CosineStep.scale))
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
      when(drop >= 6.U) {
        drop   := drop - 4.U
        cosine := cosine >> 4
      }.elsewhen(drop > 2.U) {
        drop   := drop - 1.U
        cosine := cosine >> 1
      }
      when(io.cosine.fire)(step := CosineStep.idle)
    }
  }

  io.angle.ready               := step === CosineStep.idle && squareRoot.io.radicand.ready
  squareRoot.io.radicand.valid := io.angle.valid && step === CosineStep.idle && angle.isAcute
  squareRoot.io.radicand.bits  := Mux(exponent(0), mantissa, mantissa >> 1)

  private val divides = step === CosineStep.root && isHigh
  squareRoot.io.root.ready             := divides && divider.io.division.ready
  divider.io.division.valid            := divides && squareRoot.io.root.valid
  divider.io.division.bits.numerator   := Rounding.floor(dot, formats.dotBits - numbers.mantissaBits)
  divider.io.division.bits.denominator := Rounding.floor(squareRoot.io.root.bits, rootBits - numbers.mantissaBits)
  divider.io.quotient.ready            := step === CosineStep.quotient

  private val one = 1.U << numbers.cosineFraction
  io.cosine.valid := step === CosineStep.scale && drop <= 2.U
  io.cosine.bits  := Mux(cosine(numbers.cosineFraction + 1, numbers.cosineFraction).orR, one, cosine)
}
