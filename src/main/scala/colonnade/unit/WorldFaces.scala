package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, RegEnable, Valid}
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.ObjectInstance
import colonnade.numbers.{Fixed, Rounding}

final class WorldFacesIO(config: PathConfig) extends Bundle {

  /** In the axes of an object; it may come in the next cycle. */
  val objectFace  = Flipped(Valid(new HitFace(config)))
  val mayComeNext = Output(Bool())

  /** That of the face that comes, or is in the unit; none: the face is in the axes of the world. */
  val instance     = Input(new ObjectInstance(config.device))
  val hasInstances = Input(Bool())

  /** A face is accepted in the next cycle; the context that gets its face then. */
  val mayTakeNext = Input(Bool())
  val grantNext   = Output(Valid(Context(config)))
  val face        = Output(Valid(new HitFace(config)))

  /** Of the face in the unit. */
  val context = Output(Context(config))
}

/** Transforms the normals of hits to the axes of the world, a product a cycle: some 40 cycles a hit. Source: docs/numbers.md,
  * section 10.
  */
final class WorldFaces(config: PathConfig) extends Module {
  val io = IO(new WorldFacesIO(config))

  private val products = 36 // of four normals, each by a matrix
  private val latency  = 3
  private val stored   = products + latency

  private val face   = Reg(new HitFace(config))
  private val isHeld = RegInit(false.B)
  private val step   = RegInit(0.U(log2Ceil(stored + 1).W))
  private val isDone = isHeld && (step === stored.U || !io.hasInstances)
  private val gives  = isDone && io.mayTakeNext
  when(io.objectFace.valid) {
    face   := io.objectFace.bits
    isHeld := true.B
    step   := 0.U
  }.elsewhen(isHeld && step =/= stored.U) { step := step + 1.U }
  when(gives) { isHeld := false.B }

  // A face comes in the cycle after it may come, so that it may not come in two cycles running
  private val mayCome = RegInit(false.B)
  io.mayComeNext := !isHeld && !io.objectFace.valid
  mayCome        := io.mayComeNext
  assert(!io.objectFace.valid || mayCome, "a face comes when none may")

  // Operands, products, sums of three
  private val vectors                  = face.normals.toSeq :+ face.geometricNormal
  private val normals                  = vectors.flatMap(vector => Seq.fill(3)(vector.axes.map(_.integer))).flatten
  private val rows                     = Seq.fill(4)(io.instance.normal.toSeq.flatMap(_.axes)).flatten
  private val number                   = step.min((products - 1).U)
  private val matrix                   = delayed(VecInit(rows)(number))
  private val normal                   = delayed(VecInit(normals)(number))
  private val term                     = delayed(matrix * normal)
  private val sum                      = Reg(SInt((ObjectInstance.normalBits + NumberFormats.normalBits + 2).W))
  private def isAt(product: Int): Bool = step === (product + latency - 1).U
  private val starts                   = (0 until products by 3).map(isAt).reduce(_ || _)
  private val next                     = Mux(starts, 0.S, sum) +& term
  sum := Rounding.narrow(next, sum.getWidth)
  private val most                     = NumberFormats.unitNormal
  private val whole   = Rounding.saturate(Rounding.nearestEven(next, ObjectInstance.normalFraction), -most, most)
  private val inWorld = Reg(Vec(4, Vec(3, SInt(NumberFormats.normalBits.W))))
  for (component <- 0 until 12)
    when(isAt(3 * component + 2)) { inWorld(component / 3)(component % 3) := whole }

  // The face in the world
  io.context         := face.context
  io.grantNext.valid := gives
  io.grantNext.bits  := face.context
  io.face.valid      := RegNext(gives, false.B)
  private val left = RegEnable(face, gives)
  io.face.bits := left
  when(RegNext(io.hasInstances)) {
    val components = (io.face.bits.normals.toSeq :+ io.face.bits.geometricNormal).zip(inWorld)
    for ((to, from) <- components; (component, value) <- to.axes.zip(from))
      component           := Fixed(component.format, value)
    io.face.bits.material := left.material + RegEnable(io.instance.materialBase, gives)
  }

  /** The value of the cycle before, as wide. */
  private def delayed[T <: Data](value: T): T = {
    val register = Reg(chiselTypeOf(value))
    register := value
    register
  }
}
