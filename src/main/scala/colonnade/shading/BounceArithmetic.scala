package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Cat, Mux1H}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.numbers.{RootDivider, Rounding, SquareRoot}

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

final class BounceAdderIO(config: PathConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new BounceFormats(numbers)

  val actions   = Input(new BounceActions)
  val doubles   = Input(Bool()) // double the sum, to normalise the dot product
  val takesRoot = Input(Bool()) // the root is ready to be subtracted

  // Operands
  val product        = Input(SInt(formats.productBits.W))
  val exponent       = Input(UInt(2.W))
  val squaredLengths = Input(UInt(numbers.rootBits.W))
  val root           = Input(UInt(formats.cosineBits.W))
  val cosine         = Input(UInt((NumberFormats.lightFraction + 1).W))
  val reflectance    = Input(UInt((NumberFormats.lightFraction + 1).W))
  val origin         = Input(SInt(new ShaderFormats(numbers).pointBits.W))

  /** The accumulator, and its next value. */
  val sum   = Output(SInt(formats.sumBits.W))
  val total = Output(SInt(formats.sumBits.W))
}

/** The bounce unit's only adder and its accumulator. [[BounceActions]] select the operands. */
final class BounceAdder(config: PathConfig) extends Module {
  private val formats = new BounceFormats(config.numbers)
  private val one     = 1 << NumberFormats.lightFraction

  val io = IO(new BounceAdderIO(config))

  private val actions = io.actions
  private val sum     = Reg(SInt(formats.sumBits.W))
  private val floored = Rounding.floor(io.product, NumberFormats.etaFraction)
  private val double  = (actions.scaleCosine.zipWithIndex.map { case (step, i) => step && io.exponent > i.U } ++
    actions.scaleDiscriminant.zipWithIndex.map { case (step, i) => step && io.exponent <= i.U } :+ io.doubles)
    .reduce(_ || _)

  private val left = Mux1H(
    Seq(
      ((actions.accumulate && !actions.startSum) || double || actions.subtractRoot) -> sum,
      (actions.squaredSine || actions.discriminant)                                 -> io.squaredLengths.zext,
      actions.shiftInOrigin                                                         -> Rounding.floor(io.origin, 1),
      actions.oneMinusCosine                                                        -> one.S,
      actions.addReflectance                                                        -> io.reflectance.zext
    ).map { case (when, operand) => when -> operand.pad(formats.sumBits) }
  )
  private val right = Mux1H(
    Seq(
      actions.accumulate                                                      -> io.product,
      (actions.loadProduct || actions.discriminant || actions.addReflectance) -> floored,
      double                                                                  -> sum,
      actions.squaredSine                                                     -> Rounding.floor(sum, formats.low),
      actions.subtractRoot                                                    -> io.root.zext,
      actions.shiftInOrigin  -> Rounding.floor(sum, NumberFormats.normalFraction),
      actions.oneMinusCosine -> io.cosine.zext
    ).map { case (when, operand) => when -> Rounding.narrow(operand, formats.sumBits).pad(formats.sumBits) }
  )
  private val subtract = (actions.accumulate && actions.subtract) || actions.squaredSine || actions.discriminant ||
    actions.subtractRoot || actions.oneMinusCosine

  // The offset is rounded to nearest even
  private val below   = sum.asUInt(NumberFormats.normalFraction - 1, 0)
  private val roundUp = below.head(1).asBool && (below.tail(1).orR || sum(NumberFormats.normalFraction))
  private val carry   = subtract || (actions.shiftInOrigin && roundUp)
  io.total := (Cat(left.asUInt, true.B) + Cat(Mux(subtract, ~right, right).asUInt, carry))(formats.sumBits, 1).asSInt
  when(
    actions.accumulate || double || actions.loadProduct || actions.squaredSine || actions.discriminant || io.takesRoot ||
      actions.oneMinusCosine || actions.addReflectance
  )(sum := io.total)
  io.sum := sum
}

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
  * A discriminant that is too long for the square root is divided by four until it fits, and its root is doubled as
  * often.
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
