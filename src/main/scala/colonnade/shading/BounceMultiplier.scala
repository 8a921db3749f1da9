package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Cat, Mux1H}
import colonnade.numbers.Rounding

final class BounceMultiplierIO(formats: BounceFormats) extends Bundle {
  val enable = Input(Bool())

  /** The digit of `long`: from the most significant one that holds more than sign bits, with `isFirst`, down to 0. */
  val digit   = Input(UInt(log2Ceil(formats.longDigits).W))
  val isFirst = Input(Bool())

  val wide    = Input(SInt(formats.wideBits.W))
  val long    = Input(SInt((formats.longDigits * formats.digitBits).W))
  val product = Output(SInt(formats.productBits.W)) // valid from the cycle after digit 0 to the next product
}

/** Multiplies by one digit a cycle; exact products, each in `digits` or more cycles. */
final class BounceMultiplier(formats: BounceFormats) extends Module {
  private val digitBits = formats.digitBits

  val io = IO(new BounceMultiplierIO(formats))

  private val product = Reg(SInt(formats.productBits.W))
  private val digits  = Seq.tabulate(formats.longDigits)(i => io.long.asUInt(digitBits * (i + 1) - 1, digitBits * i))
  private val digit   = Mux1H(digits.zipWithIndex.map { case (digit, i) => (io.digit === i.U) -> digit })

  // Only the first digit is signed
  private val factor  = Cat(io.isFirst && digit.head(1).asBool, digit).asSInt
  private val partial = io.wide * factor
  private val before  = Mux(io.isFirst, 0.S, product)
  private val high    = before + Rounding.floor(partial, digitBits)
  when(io.enable) {
    product := Rounding.narrow(Cat(high.asUInt, partial.asUInt(digitBits - 1, 0)).asSInt, formats.productBits)
  }
  io.product := product
}
