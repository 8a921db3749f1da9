package colonnade.shading

import chisel3._
import chisel3.util.Cat
import colonnade.config.NumberFormats
import colonnade.numbers.{RootDivider, Rounding, SquareRoot}

final class BounceRootsIO(numbers: NumberFormats) extends Bundle {
  private val formats = new BounceFormats(numbers)

  // What begins: the root of `rest`, or the cosine's root; its quotient, when that root is there
  val startRoot   = Input(Bool())
  val startCosine = Input(Bool())
  val divide      = Input(Bool())

  /** What was begun is there, to take or to divide by. */
  val isReady = Output(Bool())
  val take    = Input(Bool())

  val rest = Input(UInt(formats.lengthBits.W))
  val root = Output(UInt(formats.alongBits.W))

  /** Of both vectors, as in [[Angle]]. */
  val lengths  = Input(UInt((2 * numbers.shadeBits).W))
  val exponent = Input(UInt(3.W))

  /** n·d, its top bit set. */
  val dot      = Input(UInt((2 * numbers.shadeBits + 2).W))
  val quotient = Output(UInt((numbers.cosineFraction + 1).W))

  /** Three more than the bits by which the quotient has to move down, less those by which `dot` moved up. */
  val drop = Output(UInt(2.W))
}

/** The roots of reflection and refraction and the cosine's quotient, from one [[RootDivider]]: docs/bounce.md.
  *
  * A rest too long for the square root is quartered until it is short enough, and its root doubled as often.
  */
final class BounceRoots(numbers: NumberFormats) extends Module {
  private val formats      = new BounceFormats(numbers)
  private val radicandBits = numbers.radicandBits
  private val rootBits     = SquareRoot.rootBits(radicandBits)

  val io = IO(new BounceRootsIO(numbers))

  private val unit     = Module(new RootDivider(radicandBits, numbers.mantissaBits, numbers.cosineFraction))
  private val quarters = Seq.fill(formats.quarters)(Reg(Bool()))

  // The rest, no longer than a radicand
  private val isLonger  = Seq.tabulate(formats.quarters)(i => io.rest(formats.lengthBits - 1, radicandBits + 2 * i).orR)
  private val quartered = isLonger.foldLeft(io.rest.pad(radicandBits)) { (rest, isLonger) =>
    Mux(isLonger, Rounding.floor(rest, 2), rest)
  }
  when(io.startRoot)(quarters.zip(isLonger).foreach { case (quarter, isLonger) => quarter := isLonger })

  // The lengths' product: its top bit or the next one is set, and its exponent made even
  private val isLong   = io.lengths.head(1).asBool
  private val aligned  = Mux(isLong, io.lengths, Cat(io.lengths.tail(1), 0.U(1.W)))
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
  io.root    := quarters.foldLeft(root.pad(formats.alongBits))((root, quarter) =>
    Mux(quarter, (root << 1)(formats.alongBits - 1, 0), root)
  )
  io.quotient := unit.io.result.bits
  io.drop     := Rounding.floor(exponent, 1)
}
