package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Cat, Mux1H, PriorityEncoder, Reverse}
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.Vec3
import colonnade.numbers.{Divider, Fixed, Rounding, SquareRoot}
import colonnade.ray.RayFormats

final class BounceDatapathIO(config: ColonnadeConfig) extends Bundle {
  val control = Input(new BounceControl)
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

/** Vector registers around one multiplier, one adder, one square root and one divider; [[BounceProgram]] says when each
  * does what. Vector registers turn as in [[GeometryDatapath]].
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

  /** The squared index; then the cosine on its way down to its place; then twice what it lacks to one. */
  private val scalar = Reg(UInt(scalarBits.W))

  /** Three more than the bits by which the cosine has to move down. */
  private val drop = Reg(UInt(log2Ceil(dotBits + 5).W))

  private val product = Reg(SInt(formats.productBits.W))
  private val sum     = Reg(SInt(formats.sumBits.W))

  // Scale by the normal's length: its square's highest bit is one of the top four of a dot product
  private val top         = sum.asUInt(dotBits - 1, dotBits - 4)
  private val topExponent = Mux(top(3, 1).orR, 3.U - PriorityEncoder(Reverse(top(3, 1))), 0.U)
  private val scaled      = Rounding.floor(
    Rounding.floor(sum.asUInt(dotBits - 1, 0), shadeBits - 1),
    Mux(control.keepSquare, topExponent, exponent)
  )

  // Factors
  private val positive      = Mux(sum < 0.S, 0.U, sum.asUInt(numbers.rootBits - 1, 0)).zext
  private val along         = across.asUInt(formats.alongBits - 1, 0)
  private val twice         = Cat(along, 0.U(1.W)).zext
  private val mantissa      = Mux(square(shadeBits), Rounding.floor(square, 1), square)(shadeBits - 1, 0).zext
  private val normalSquared = parallel(shadeBits - 1, 0).zext
  private val twicePower    = Cat(sum.asUInt(oneBits, 0), 0.U(1.W)).zext
  private val twiceRest     = (((1 << oneBits).S -& reflectance.zext) << 1).asSInt

  private val Seq(wideParallel, wideEta, narrowEta, narrowScalar) = Seq(parallel, eta, eta, scalar).map(_.zext)

  private val choices: Seq[(Bool, (SInt, SInt))] = Seq(
    control.squareNormal -> (normal(0)      -> normal(0)),
    control.project      -> (normal(0)      -> towards(0)),
    control.squareRay    -> (towards(0)     -> towards(0)),
    control.parallel     -> (wideParallel   -> towards(0)),
    control.acrossTwice  -> (twice          -> normal(0)),
    control.across       -> (across         -> normal(0)),
    control.whole        -> (square.zext    -> normalSquared),
    control.upright      -> (across         -> along.zext),
    control.squareEta    -> (wideEta        -> narrowEta),
    control.bend         -> (positive       -> narrowScalar),
    control.etaAlong     -> (across         -> narrowEta),
    control.etaSquare    -> (wideParallel   -> narrowEta),
    control.side         -> (direction(0)   -> facing(0)),
    control.offset       -> (io.offset.zext -> facing(0)),
    control.lengths      -> (mantissa       -> normalSquared),
    control.power        -> (positive       -> narrowScalar),
    control.powerSquare  -> (positive       -> twicePower),
    control.powerRest    -> (positive       -> twiceRest)
  )

  /** Every operand once, for all products that take it. */
  private def select(width: Int, operands: Seq[(Bool, SInt)]): SInt = {
    val different = operands.map(_._2).distinct
    Mux1H(different.map(operand => operands.filter(_._2 eq operand).map(_._1).reduce(_ || _) -> operand.pad(width)))
  }
  private val wide   = select(formats.wideBits, choices.map { case (when, (wide, _)) => when -> wide })
  private val narrow = select(formats.narrowBits, choices.map { case (when, (_, narrow)) => when -> narrow })
  when(choices.map(_._1).reduce(_ || _))(product := wide * narrow)

  // Square root: a length too long is quartered, and its root doubled as often
  private val squareRoot = Module(new SquareRoot(numbers.radicandBits))
  private val rootBits   = SquareRoot.rootBits(numbers.radicandBits)
  private val isOver     = Seq.fill(formats.quarters)(Reg(Bool()))
  private val rest       = Rounding.floor(sum.asUInt(numbers.rootBits + 2, 0), 3 - formats.low)
  private val isLonger   =
    Seq.tabulate(formats.quarters)(i => rest(formats.lengthBits - 1, numbers.radicandBits + 2 * i).orR)
  private val quartered = isLonger.foldLeft(rest.pad(numbers.radicandBits)) { (rest, over) =>
    Mux(over, Rounding.floor(rest, 2), rest)
  }
  private val root = isOver.foldLeft(squareRoot.io.root.bits.pad(formats.alongBits)) { (root, over) =>
    Mux(over, Cat(root, 0.U(1.W)), root)
  }
  when(control.root)(isOver.zip(isLonger).foreach { case (held, over) => held := over })

  // The cosine's: the lengths' product, its top bit or the next one set, and its exponent made even
  private val lengths       = product.asUInt(2 * shadeBits - 1, 0)
  private val isLong        = lengths(2 * shadeBits - 1)
  private val aligned       = Mux(isLong, lengths, Cat(lengths(2 * shadeBits - 2, 0), 0.U(1.W)))
  private val radicand      = Rounding.floor(aligned, 2 * shadeBits - numbers.radicandBits)
  private val rootExponent  = exponent +& square(shadeBits) +& isLong
  private val cosineOperand = Mux(rootExponent(0), radicand, Rounding.floor(radicand, 1))
  squareRoot.io.radicand.valid := control.root || (control.cosineRoot && io.isPositive)
  squareRoot.io.radicand.bits  :=
    Mux(control.root, Rounding.narrow(quartered, numbers.radicandBits), cosineOperand)

  // The dot product moves up until its top bit is set, while the root is on its way
  private val divider = Module(new Divider(numbers.mantissaBits, numbers.cosineFraction))
  private val isHigh  = sum.asUInt(dotBits - 1)
  private val dot     = sum.asUInt(dotBits - 1, 0)
  private val raise   = control.divide && !isHigh
  private val divides = control.divide && isHigh && squareRoot.io.root.valid
  divider.io.division.valid            := divides
  divider.io.division.bits.numerator   := Rounding.floor(dot, dotBits - numbers.mantissaBits)
  divider.io.division.bits.denominator := Rounding.floor(squareRoot.io.root.bits, rootBits - numbers.mantissaBits)
  divider.io.quotient.ready            := control.takeQuotient
  squareRoot.io.root.ready             := control.takeRoot || divides

  private val takesRoot = control.takeRoot && squareRoot.io.root.valid
  private val falls     = control.lower && drop > 3.U
  io.waits := (control.takeRoot && !takesRoot) || (control.divide && !divides) ||
    (control.takeQuotient && !divider.io.quotient.valid) || falls

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
  private val doubles = control.lengthen.zipWithIndex.map { case (step, i) => step && exponent > i.U } ++
    control.lengthenAgain.zipWithIndex.map { case (step, i) => step && exponent <= i.U } :+ raise
  private val double = doubles.reduce(_ || _)
  private val left   = Mux1H(
    Seq(
      ((control.accumulate && !control.first) || double || control.takeRoot) -> sum,
      (control.lessUpright || control.lessBent)                              -> whole.zext,
      control.pushOrigin                                                     -> Rounding.floor(origin(0), 1),
      control.away                                                           -> (1 << oneBits).S,
      control.addReflectance                                                 -> reflectance.zext
    ).map { case (when, operand) => when -> operand.pad(formats.sumBits) }
  )
  private val right = Mux1H(
    Seq(
      control.accumulate                                                  -> product,
      (control.takeProduct || control.lessBent || control.addReflectance) -> floored,
      double                                                              -> sum,
      control.lessUpright                                                 -> Rounding.floor(sum, formats.low),
      control.takeRoot                                                    -> root.zext,
      control.pushOrigin -> Rounding.floor(sum, NumberFormats.normalFraction),
      control.away       -> cosine.zext
    ).map { case (when, operand) => when -> Rounding.narrow(operand, formats.sumBits).pad(formats.sumBits) }
  )
  private val subtract = (control.accumulate && control.subtract) || control.lessUpright || control.lessBent ||
    control.takeRoot || control.away

  /** The rounding of the offset that is added: its half and what is below, and ties to even. */
  private val below   = sum.asUInt(NumberFormats.normalFraction - 1, 0)
  private val roundUp = below.head(1).asBool &&
    (below.tail(1).orR || sum(NumberFormats.normalFraction))
  private val carry = subtract || (control.pushOrigin && roundUp)
  private val total =
    (Cat(left.asUInt, true.B) + Cat(Mux(subtract, ~right, right).asUInt, carry))(formats.sumBits, 1).asSInt
  when(
    control.accumulate || double || control.takeProduct || control.lessUpright || control.lessBent || takesRoot ||
      control.away || control.addReflectance
  )(sum := total)
  io.isPositive := !io.isNegative && sum =/= 0.S
  io.isNegative := sum < 0.S

  // Scalars
  when(control.keepSquare) {
    exponent := topExponent
    parallel := scaled(shadeBits - 1, 0)
  }
  when(control.keepAlong)(across      := Mux(sum < 0.S, 0.U, scaled(formats.alongBits - 1, 0)).zext)
  when(control.keepRay)(square        := Rounding.floor(dot, shadeBits - 1)(formats.squareBits - 1, 0))
  when(control.keepWhole)(whole       := Rounding.floor(sum.asUInt(formats.lengthBits - 1, 0), formats.low))
  when(control.keepParallel)(parallel := floored.asUInt(formats.parallelBits - 1, 0))
  when(control.keepAcross)(across     := Rounding.narrow(sum, formats.acrossBits))
  when(control.keepSquareEta)(scalar  := floored.asUInt(formats.etaSquareBits - 1, 0))
  when(control.takeQuotient)(scalar   := divider.io.quotient.bits)
  when(control.away)(scalar           := Cat(total.asUInt(oneBits, 0), 0.U(1.W)))
  when(control.cosineRoot) {
    scalar := 0.U
    drop   := Mux(io.isPositive, Rounding.floor(rootExponent, 1), 3.U)
  }
  when(raise)(drop := drop + 1.U)
  when(falls) {
    scalar := Rounding.floor(scalar, 1)
    drop   := drop - 1.U
  }

  // Vectors
  private val going = Rounding.floor(sum, shadeBits - 4)
  when(control.squareNormal || control.project || control.acrossTwice || control.across)(turn(normal, normal(0)))
  when(control.project || control.squareRay || control.parallel)(turn(towards, towards(0)))
  when(control.side || control.offset)(turn(facing, facing(0)))
  when(control.pushReflection || control.pushRefraction || control.side) {
    turn(direction, Mux(control.side, direction(0), Rounding.narrow(going, formats.bounceBits)))
  }
  when(control.pushReflection)(turn(reflection, going))
  when(control.pushOrigin)(turn(origin, Cat(total.asUInt, origin(0)(0)).asSInt))

  // Long is what lies outside −2^(shadeBits − 1) < x < 2^(shadeBits − 1)
  private val isLongest = normal.map { x =>
    val Seq(sign, next) = Seq(shadeBits, shadeBits - 1).map(x.asUInt(_))
    sign =/= next || (sign && !x.asUInt(shadeBits - 2, 0).orR)
  }.reduce(_ || _)
  for (axis <- 0 until 3) {
    when(control.normalise && !isLongest)(normal(axis) := Rounding.narrow(
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
