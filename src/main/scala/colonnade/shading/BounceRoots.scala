package colonnade.shading

import chisel3._
import chisel3.util.Cat
import colonnade.config.NumberFormats
import colonnade.numbers.{RootDivider, Rounding, SquareRoot}

final class BounceRootsIO(numbers: NumberFormats) extends Bundle {
  private val formats = new BounceFormats(numbers)

  // Starts the discriminant's root, the cosine's root, or, once that root is ready, the cosine's quotient
  val startRoot   = Input(Bool())
  val startCosine = Input(Bool())
  val divide      = Input(Bool())

  val isReady = Output(Bool()) // the root or quotient is ready
  val take    = Input(Bool())  // takes the result

  val discriminant = Input(UInt(formats.lengthBits.W))
  val root         = Output(UInt(formats.cosineBits.W))

  /** Product and exponent of the vectors' squared lengths, as in [[Angle]]. */
  val normProduct = Input(UInt((2 * numbers.shadeBits).W))
  val exponent    = Input(UInt(3.W))

  val dot      = Input(UInt((2 * numbers.shadeBits + 2).W)) // n·d, with its top bit set
  val quotient = Output(UInt((numbers.cosineFraction + 1).W))

  /** Three more than the bits by which the quotient has to move down, without those by which `dot` moved up. */
  val shiftRight = Output(UInt(2.W))
}

/** The root of Snell's discriminant and the cosine's root and quotient, from one `RootDivider`: docs/shading.md.
  *
  * A discriminant that is too long for the square root is divided by four until it fits, and its root is doubled as often.
  */
final class BounceRoots(numbers: NumberFormats) extends Module {
  private val formats      = new BounceFormats(numbers)
  private val radicandBits = numbers.radicandBits
  private val rootBits     = SquareRoot.rootBits(radicandBits)

  val io = IO(new BounceRootsIO(numbers))

  private val unit     = Module(new RootDivider(radicandBits, numbers.mantissaBits, numbers.cosineFraction))
  private val quarters = Seq.fill(formats.quarters)(Reg(Bool()))

  // The discriminant, no longer than a radicand
  private val isLonger =
    Seq.tabulate(formats.quarters)(i => io.discriminant(formats.lengthBits - 1, radicandBits + 2 * i).orR)
  private val quartered = isLonger.foldLeft(io.discriminant.pad(radicandBits)) { (radicand, isLonger) =>
    Mux(isLonger, Rounding.floor(radicand, 2), radicand)
  }
  when(io.startRoot)(quarters.zip(isLonger).foreach { case (quarter, isLonger) => quarter := isLonger })

  // The product of both squared lengths: one of its two top bits is set. Its exponent is made even
  private val isLong   = io.normProduct.head(1).asBool
  private val aligned  = Mux(isLong, io.normProduct, Cat(io.normProduct.tail(1), 0.U(1.W)))
  private val mantissa = Rounding.floor(aligned, aligned.getWidth - radicandBits)
  private val exponent = io.exponent + isLong
  private val radicand = Mux(exponent(0), mantissa, Rounding.floor(mantissa, 1))

  private val starts    = io.startRoot || io.startCosine
  private val operation = unit.io.operation
  private val root      = unit.io.result.bits(rootBits - 1, 0)
  operation.valid           := starts || (io.divide && unit.io.result.valid)
  operation.bits.isDivision := io.divide
  operation.bits.operand    := Mux(
    io.divide,
    Rounding.floor(root, rootBits - numbers.mantissaBits),
    Mux(io.startRoot, Rounding.narrow(quartered, radicandBits), radicand)
  )
  operation.bits.numerator := Rounding.floor(io.dot, io.dot.getWidth - numbers.mantissaBits)
  unit.io.result.ready     := io.take || io.divide

  io.isReady := unit.io.result.valid
  io.root    := quarters.foldLeft(root.pad(formats.cosineBits))((root, quarter) =>
    Mux(quarter, (root << 1)(formats.cosineBits - 1, 0), root)
  )
  io.quotient   := unit.io.result.bits
  io.shiftRight := Rounding.floor(exponent, 1)
}
