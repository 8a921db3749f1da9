package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Cat, Valid}
import colonnade.config.{AttributeLayout, ColonnadeConfig, PathConfig}
import colonnade.numbers.{Divider, Division, Normalise, Rounding}

/** Operands of the march's multiplier. */
final class MarchFactors(formats: MarchFormats) extends Bundle {
  val wide   = SInt(formats.wideBits.W)
  val narrow = SInt(formats.narrowBits.W)
}

/** Operands of an adder: base + addend or base - addend. */
final class MarchAddition(bits: Int) extends Bundle {
  val base     = SInt(bits.W)
  val addend   = SInt(bits.W)
  val subtract = Bool()

  def result: SInt =
    Rounding.narrow(base + (addend ^ Mux(subtract, (-1).S(bits.W), 0.S(bits.W))) + Cat(0.U(1.W), subtract).asSInt, bits)
}

final class MarchDatapathIO(formats: MarchFormats) extends Bundle {
  import formats._

  val multiply = Flipped(Valid(new MarchFactors(formats)))  // latches a product
  val product  = Output(SInt(productBits.W))
  val add      = Flipped(Valid(new MarchAddition(sumBits))) // latches a sum
  val sum      = Output(SInt(sumBits.W))

  /** Bits of the sum without its sign, in this cycle; and as latched. */
  val sumExponent   = Output(UInt(exponentBits.W))
  val latchExponent = Input(Bool())
  val exponent      = Output(UInt(exponentBits.W))

  val shift   = Flipped(Valid(SInt(shiftBits.W))) // latches the shift for the outputs below, floor(sum · 2^(f − shift))
  val shifted = Output(SInt(scaledBits.W))        // the low bits

  // Saturated; the sum's exponent must be latched. The natural ones are for sums that are not negative
  val coordinate = Output(SInt((alongBits + 1).W))
  val along      = Output(UInt(alongBits.W))
  val distance   = Output(UInt(distanceBits.W))

  /** The small adder; combinational, and latched. */
  val combine      = Flipped(Valid(new MarchAddition(combineBits)))
  val combined     = Output(SInt(combineBits.W))
  val lastCombined = Output(SInt(combineBits.W))

  val divide       = Flipped(Valid(new Division(f))) // starts a division of mantissas, one at a time
  val quotient     = Valid(UInt((f + 1).W))
  val takeQuotient = Input(Bool())
}

/** The arithmetic of the march: one multiplier, an accumulator with a shifter, a small adder and a divider.
  *
  * A product can be added one step after its factors, and the sum can be used one step later.
  */
final class MarchDatapath(config: PathConfig) extends Module {
  private val formats = new MarchFormats(config.device)
  import formats._

  val io = IO(new MarchDatapathIO(formats))

  private val product  = Reg(chiselTypeOf(io.product))
  private val sum      = Reg(chiselTypeOf(io.sum))
  private val exponent = Reg(chiselTypeOf(io.exponent))
  private val shift    = Reg(chiselTypeOf(io.shift.bits))

  when(io.multiply.valid)(product := io.multiply.bits.wide * io.multiply.bits.narrow)
  when(io.add.valid)(sum          := io.add.bits.result)
  io.product  := product
  io.sum      := sum
  io.combined := io.combine.bits.result

  private val lastCombined = Reg(chiselTypeOf(io.combined))
  when(io.combine.valid)(lastCombined := io.combined)
  io.lastCombined := lastCombined

  io.sumExponent := Normalise.bitLength(Mux(sum < 0.S, ~sum, sum).asUInt)
  io.exponent    := exponent
  when(io.latchExponent)(exponent := io.sumExponent)
  when(io.shift.valid)(shift      := io.shift.bits)

  // The sum with f fraction bits, shifted right
  private val amountBits = Normalise.exponentBits(sumBits + f)
  private val isTooFar   = shift >= (sumBits + f).S
  private val amount     = Mux(shift < 0.S, 0.U, Mux(isTooFar, (sumBits + f).U, shift.asUInt))(amountBits - 1, 0)
  io.shifted := Rounding.narrow(Cat(sum, 0.U(f.W)).asSInt >> amount, scaledBits)

  io.coordinate := saturate(alongBits)
  io.along      := saturateNatural(alongBits)
  io.distance   := saturateNatural(distanceBits)

  private val divider = Module(new Divider(f, f, digitsPerCycle = 2))
  divider.io.division.valid := io.divide.valid
  divider.io.division.bits  := io.divide.bits
  divider.io.quotient.ready := io.takeQuotient
  io.quotient.valid         := divider.io.quotient.valid
  io.quotient.bits          := divider.io.quotient.bits
  assert(!divider.io.division.valid || divider.io.division.ready, "a division during another one")

  /** The shifted sum has more than so many bits. */
  private def exceeds(bits: Int): Bool = sum =/= 0.S && (shift < 0.S || exponent.zext +& (f - bits).S > shift)

  private def saturate(bits: Int): SInt = {
    val limit = Mux(sum < 0.S, (-(BigInt(1) << bits)).S((bits + 1).W), ((BigInt(1) << bits) - 1).S((bits + 1).W))
    Mux(exceeds(bits), limit, Rounding.narrow(io.shifted, bits + 1))
  }

  private def saturateNatural(bits: Int): UInt =
    Mux(exceeds(bits), ((BigInt(1) << bits) - 1).U(bits.W), io.shifted.asUInt(bits - 1, 0))
}

/** Widths of the march; f is `shadeBits`.
  *
  * Directions, projections and mantissas have f bits. The coordinates u, v and w reach 2^(f + 3), and so does the
  * distance along the ray.
  */
final class MarchFormats(config: ColonnadeConfig) {
  private val numbers = config.numbers

  val layout:    AttributeLayout = AttributeLayout.of(config)
  val f:         Int             = numbers.shadeBits
  val sceneBits: Int             = numbers.sceneBits

  val mapLog:        Int = 10         // log2 of the map's unit in pixels
  val pixelFraction: Int = f - mapLog // fraction bits of a pixel's coordinate
  val planeFraction: Int = 22         // fraction bits of a plane's coefficients with exponent 0
  val guardBits:    Int = 8 // additional fraction bits of a distance along the ray while distances are added up
  val alongBits:    Int = f + 3
  val distanceBits: Int = alongBits + guardBits
  val nearLog:      Int = 8 // log2 of a share of w: a ray that is behind a surface by less is on it

  /** A ray that crosses tiles and cells this often ends. A map of the finest cells has 31 on the longest way through a
    * tile.
    */
  val maxSteps: Int = 512
  val stepBits: Int = log2Ceil(maxSteps + 1)

  val originBits:    Int = f + 5
  val directionBits: Int = f + 4
  val narrowBits:    Int = AttributeLayout.coefficientBits.max(alongBits + 1)

  /** A plane's depth at the ray's origin, its slope, and its depth at a distance along the ray. */
  val valueBits: Int = planeFraction + 6
  val slopeBits: Int = planeFraction + 2
  val depthBits: Int = valueBits + 2

  val wideBits:    Int = originBits.max(slopeBits).max(numbers.macBits.min(32)) // a component of the matrix
  val productBits: Int = wideBits + narrowBits

  val sumBits:      Int = (numbers.macBits + sceneBits + 3).min(128).max(productBits) // the model's widest has 128
  val scaledBits:   Int = depthBits + f - 7                                           // a depth in steps of w
  val combineBits:  Int = scaledBits + 1
  val exponentBits: Int = 8
  val shiftBits: Int = 12 // shift amounts, and exponents that may be negative
  val tileBits:  Int = 9  // a coordinate in tiles, with one bit to spare

  val centre: Seq[BigInt] = sizes.map(size => BigInt(size) << (pixelFraction - 1)) // half the map's size in map units

  def sizes: Seq[Int] = Seq(layout.config.width, layout.config.height)
}
