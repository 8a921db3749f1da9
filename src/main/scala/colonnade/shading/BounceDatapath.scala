package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Cat, Mux1H, PriorityEncoder, Reverse}
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.Vec3
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.RayFormats

final class BounceDatapathIO(config: ColonnadeConfig) extends Bundle {
  val control = Input(new BounceControl(new BounceFormats(config.numbers)))
  val request = Input(new BounceRequest(config))
  val offset  = Input(UInt((config.numbers.gridBits - 2).W))

  /** The ray enters what it has met. */
  val isRefraction = Input(Bool())

  /** What this step needs is not there yet: it has to be repeated. */
  val waits = Output(Bool())

  /** Of the sum. */
  val isPositive = Output(Bool())
  val isNegative = Output(Bool())

  /** Constant from the last step on. */
  val result = Output(new BounceResult(config))
}

/** Vector registers around one multiplier, one adder, and roots; [[BounceProgram]] says when each does what. Vector
  * registers turn as in [[GeometryDatapath]].
  */
final class BounceDatapath(config: ColonnadeConfig) extends Module {
  private val numbers    = config.numbers
  private val formats    = new BounceFormats(numbers)
  private val shadeBits  = formats.shadeBits
  private val oneBits    = NumberFormats.lightFraction
  private val dotBits    = 2 * shadeBits + 2
  private val scalarBits = formats.etaSquareBits.max(numbers.cosineFraction + 1)

  val io = IO(new BounceDatapathIO(config))

  private val control = io.control
  private val factors = control.factors
  private val work    = control.work

  private def vector(bits: Int): Vec[SInt] = Reg(Vec(3, SInt(bits.W)))

  private def turn(vector: Vec[SInt], entering: SInt): Unit = {
    vector(0) := vector(1)
    vector(1) := vector(2)
    vector(2) := Rounding.narrow(entering, vector(2).getWidth)
  }

  private val origin      = vector(io.request.origin.x.getWidth)
  private val normal      = vector(formats.componentBits)
  private val facing      = vector(formats.facingBits)
  private val towards     = vector(formats.componentBits)
  private val direction   = vector(formats.bounceBits)
  private val reflection  = vector(formats.bounceBits)
  private val context     = Reg(chiselTypeOf(io.request.context))
  private val eta         = Reg(UInt(NumberFormats.etaBits.W))
  private val reflectance = Reg(UInt((oneBits + 1).W))

  /** What the ray's direction and the normal are multiplied by: |n|² and n·d at first. */
  private val parallel = Reg(UInt(formats.parallelBits.W))
  private val across   = Reg(SInt(formats.acrossBits.W))

  /** |d|², and the product of both squared lengths. */
  private val square = Reg(UInt(formats.squareBits.W))
  private val whole  = Reg(UInt(numbers.rootBits.W))

  /** By how many bits |n|² is longer than its shortest. */
  private val exponent = Reg(UInt(2.W))

  /** The squared index; then the cosine on its way down to its place; then twice what it lacks to one. The powers are
    * products with a factor doubled, so that they too drop 13 bits.
    */
  private val scalar = Reg(UInt(scalarBits.W))

  /** Three more than the bits by which the cosine has to move down. */
  private val drop = Reg(UInt(log2Ceil(dotBits + 5).W))

  private val sum = Reg(SInt(formats.sumBits.W))

  // Scale by the normal's length: its square's highest bit is one of the top four of a dot product
  private val top         = sum.asUInt(dotBits - 1, dotBits - 4)
  private val topExponent = Mux(top(3, 1).orR, 3.U - PriorityEncoder(Reverse(top(3, 1))), 0.U)
  private val scaled      = Rounding.floor(
    Rounding.floor(sum.asUInt(dotBits - 1, 0), shadeBits - 1),
    Mux(work.keepSquare, topExponent, exponent)
  )

  // Factors
  private val positive      = Mux(sum < 0.S, 0.U, sum.asUInt(numbers.rootBits - 1, 0)).zext
  private val along         = across.asUInt(formats.alongBits - 1, 0)
  private val twice         = Cat(along, 0.U(1.W)).zext
  private val mantissa      = Mux(square(shadeBits), Rounding.floor(square, 1), square)(shadeBits - 1, 0).zext
  private val normalSquared = parallel(shadeBits - 1, 0).zext
  private val twicePower    = Cat(sum.asUInt(oneBits, 0), 0.U(1.W)).zext
  private val twiceRest     = (((1 << oneBits).S -& reflectance.zext) << 1).asSInt

  private val Seq(wideParallel, wideEta, longEta, wideScalar) = Seq(parallel, eta, eta, scalar).map(_.zext)

  private val choices: Seq[(Bool, (SInt, SInt))] = Seq(
    factors.squareNormal -> (normal(0)    -> normal(0)),
    factors.project      -> (normal(0)    -> towards(0)),
    factors.squareRay    -> (towards(0)   -> towards(0)),
    factors.parallel     -> (wideParallel -> towards(0)),
    factors.acrossTwice  -> (twice        -> normal(0)),
    factors.across       -> (across       -> normal(0)),
    factors.whole        -> (square.zext  -> normalSquared),
    factors.upright      -> (across       -> along.zext),
    factors.squareEta    -> (wideEta      -> longEta),
    factors.bend         -> (wideScalar   -> positive),
    factors.etaAlong     -> (across       -> longEta),
    factors.etaSquare    -> (wideParallel -> longEta),
    factors.side         -> (direction(0) -> facing(0)),
    factors.offset       -> (facing(0)    -> io.offset.zext),
    factors.lengths      -> (mantissa     -> normalSquared),
    factors.power        -> (wideScalar   -> positive),
    factors.powerSquare  -> (twicePower   -> positive),
    factors.powerRest    -> (twiceRest    -> positive)
  )

  /** Every operand once, for all products that take it. */
  private def select(width: Int, operands: Seq[(Bool, SInt)]): SInt = {
    val different = operands.map(_._2).distinct
    Mux1H(different.map(operand => operands.filter(_._2 eq operand).map(_._1).reduce(_ || _) -> operand.pad(width)))
  }
  private val wide = select(formats.wideBits, choices.map { case (when, (wide, _)) => when -> wide })
  private val long =
    select(formats.longDigits * formats.digitBits, choices.map { case (when, (_, long)) => when -> long })

  private val multiplier = Module(new BounceMultiplier(formats))
  private val product    = multiplier.io.product
  multiplier.io.enable  := factors.any
  multiplier.io.isFirst := control.isFirst
  multiplier.io.digit   := control.digit
  multiplier.io.wide    := wide
  multiplier.io.long    := long

  // Roots and quotient. The dot product moves up until its top bit is set, while the root is on its way
  private val roots     = Module(new BounceRoots(numbers))
  private val dot       = sum.asUInt(dotBits - 1, 0)
  private val isHigh    = sum.asUInt(dotBits - 1)
  private val raise     = work.divide && !isHigh
  private val takesRoot = work.takeRoot && roots.io.isReady
  private val falls     = work.lower && drop > 3.U
  roots.io.startRoot   := work.root
  roots.io.startCosine := work.cosineRoot && io.isPositive
  roots.io.divide      := work.divide && isHigh
  roots.io.take        := work.takeRoot || work.takeQuotient
  roots.io.rest        := Rounding.floor(sum.asUInt(numbers.rootBits + 2, 0), 3 - formats.low)
  roots.io.lengths     := product.asUInt(2 * shadeBits - 1, 0)
  roots.io.exponent    := exponent +& square(shadeBits)
  roots.io.dot         := dot
  io.waits             := falls || raise || ((work.takeRoot || work.divide || work.takeQuotient) && !roots.io.isReady)

  // The cosine in a light's format; a quotient that had to move up is more than one
  private val quotient = scalar(numbers.cosineFraction - 1, 0)
  private val isOne    = drop < 3.U || scalar(numbers.cosineFraction)
  private val cosine   = Mux(
    isOne,
    (1 << oneBits).U,
    Rounding.floor(quotient, numbers.cosineFraction - oneBits).pad(oneBits + 1)
  )

  // Adder
  private val floored = Rounding.floor(product, NumberFormats.etaFraction)
  private val doubles = work.lengthen.zipWithIndex.map { case (step, i) => step && exponent > i.U } ++
    work.lengthenAgain.zipWithIndex.map { case (step, i) => step && exponent <= i.U } :+ raise
  private val double = doubles.reduce(_ || _)
  private val left   = Mux1H(
    Seq(
      ((work.accumulate && !work.first) || double || work.takeRoot) -> sum,
      (work.lessUpright || work.lessBent)                           -> whole.zext,
      work.pushOrigin                                               -> Rounding.floor(origin(0), 1),
      work.away                                                     -> (1 << oneBits).S,
      work.addReflectance                                           -> reflectance.zext
    ).map { case (when, operand) => when -> operand.pad(formats.sumBits) }
  )
  private val right = Mux1H(
    Seq(
      work.accumulate                                            -> product,
      (work.takeProduct || work.lessBent || work.addReflectance) -> floored,
      double                                                     -> sum,
      work.lessUpright                                           -> Rounding.floor(sum, formats.low),
      work.takeRoot                                              -> roots.io.root.zext,
      work.pushOrigin                                            -> Rounding.floor(sum, NumberFormats.normalFraction),
      work.away                                                  -> cosine.zext
    ).map { case (when, operand) => when -> Rounding.narrow(operand, formats.sumBits).pad(formats.sumBits) }
  )
  private val subtract = (work.accumulate && work.subtract) || work.lessUpright || work.lessBent ||
    work.takeRoot || work.away

  /** The rounding of the offset that is added: its half and what is below, and ties to even. */
  private val below   = sum.asUInt(NumberFormats.normalFraction - 1, 0)
  private val roundUp = below.head(1).asBool &&
    (below.tail(1).orR || sum(NumberFormats.normalFraction))
  private val carry = subtract || (work.pushOrigin && roundUp)
  private val total =
    (Cat(left.asUInt, true.B) + Cat(Mux(subtract, ~right, right).asUInt, carry))(formats.sumBits, 1).asSInt
  when(
    work.accumulate || double || work.takeProduct || work.lessUpright || work.lessBent || takesRoot ||
      work.away || work.addReflectance
  )(sum := total)
  io.isPositive := !io.isNegative && sum =/= 0.S
  io.isNegative := sum < 0.S

  // Scalars
  when(work.keepSquare) {
    exponent := topExponent
    parallel := scaled(shadeBits - 1, 0)
  }
  when(work.keepAlong)(across      := Mux(sum < 0.S, 0.U, scaled(formats.alongBits - 1, 0)).zext)
  when(work.keepRay)(square        := Rounding.floor(dot, shadeBits - 1)(formats.squareBits - 1, 0))
  when(work.keepWhole)(whole       := Rounding.floor(sum.asUInt(formats.lengthBits - 1, 0), formats.low))
  when(work.keepParallel)(parallel := floored.asUInt(formats.parallelBits - 1, 0))
  when(work.keepAcross)(across     := Rounding.narrow(sum, formats.acrossBits))
  when(work.keepSquareEta)(scalar  := floored.asUInt(formats.etaSquareBits - 1, 0))
  when(work.takeQuotient)(scalar   := roots.io.quotient)
  when(work.away)(scalar           := Cat(total.asUInt(oneBits, 0), 0.U(1.W)))
  when(work.cosineRoot) {
    scalar := 0.U
    drop   := Mux(io.isPositive, roots.io.drop, 3.U)
  }
  when(raise)(drop := drop + 1.U)
  when(falls) {
    scalar := Rounding.floor(scalar, 1)
    drop   := drop - 1.U
  }

  // Vectors turn when they have been multiplied
  private val going = Rounding.floor(sum, shadeBits - 4)

  private def uses(by: Bool*): Bool = control.digit === 0.U && by.reduce(_ || _)
  when(uses(factors.squareNormal, factors.project, factors.acrossTwice, factors.across))(turn(normal, normal(0)))
  when(uses(factors.project, factors.squareRay, factors.parallel))(turn(towards, towards(0)))
  when(uses(factors.side, factors.offset))(turn(facing, facing(0)))
  when(work.pushReflection || work.pushRefraction || uses(factors.side)) {
    turn(direction, Mux(factors.side, direction(0), Rounding.narrow(going, formats.bounceBits)))
  }
  when(work.pushReflection)(turn(reflection, going))
  when(work.pushOrigin)(turn(origin, Cat(total.asUInt, origin(0)(0)).asSInt))

  // Long is what lies outside −2^(shadeBits − 1) < x < 2^(shadeBits − 1)
  private val isLongest = normal.map { x =>
    val Seq(sign, next) = Seq(shadeBits, shadeBits - 1).map(x.asUInt(_))
    sign =/= next || (sign && !x.asUInt(shadeBits - 2, 0).orR)
  }.reduce(_ || _)
  for (axis <- 0 until 3) {
    when(work.normalise && !isLongest)(normal(axis) := Rounding.narrow(
      (normal(axis) << 1).asSInt,
      formats.componentBits
    ))
    when(control.startOver) {
      normal(axis) := (facing(axis) << (shadeBits - NumberFormats.normalBits)).asSInt
    }
  }

  when(control.load) {
    val request = io.request
    for (axis <- 0 until 3) {
      origin(axis)  := request.origin.axes(axis)
      normal(axis)  := request.normal.axes(axis)
      facing(axis)  := request.facing.axes(axis)
      towards(axis) := request.towards.axes(axis)
    }
    context     := request.context
    eta         := request.eta.natural
    reflectance := request.reflectance.natural
  }

  // Result
  private val scene                          = new RayFormats(numbers).scene
  private val Seq(originX, originY, originZ) = origin.map(Fixed(scene, _))
  private val Seq(x, y, z)                   = direction.map(_.pad(numbers.directionBits))
  io.result.context      := context
  io.result.isRefraction := io.isRefraction
  io.result.origin       := Vec3.of(originX, originY, originZ)
  io.result.towards      := Vec3.of(x, y, z)
  io.result.reflection   := Vec3.of(reflection(0), reflection(1), reflection(2))
  io.result.share.raw    := sum.asUInt(oneBits, 0)
}
