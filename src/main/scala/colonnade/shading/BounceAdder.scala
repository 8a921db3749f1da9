package colonnade.shading

import chisel3._
import chisel3.util.{Cat, Mux1H}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.numbers.Rounding

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
