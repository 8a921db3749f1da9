package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Valid}
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.ObjectInstance
import colonnade.numbers.{Fixed, Rounding}

final class WorldFacesIO(config: PathConfig) extends Bundle {

  /** In the axes of an object; it may come in the next cycle. */
  val objectFace  = Flipped(Valid(new HitFace(config)))
  val mayComeNext = Output(Bool())

  /** Constant while a face is in the unit. */
  val instances = Input(Vec(config.device.frame.instances, new ObjectInstance(config.device)))

  /** A face is accepted in the next cycle; the context that gets its face then. */
  val mayTakeNext = Input(Bool())
  val grantNext   = Output(Valid(Context(config)))
  val face        = Output(Valid(new HitFace(config)))
}

/** Transforms the normals of hits to the axes of the world, a normal a cycle: some seven cycles a hit. Source:
  * docs/numbers.md, section 10.
  */
final class WorldFaces(config: PathConfig) extends Module {
  val io = IO(new WorldFacesIO(config))

  private val vectors = 4
  private val stored  = vectors + 1

  // A face, whose normals go round: the first one is multiplied, and comes back as the last one, of the world, two steps
  // later. A face comes in the cycle after it may come
  private val face     = Reg(new HitFace(config))
  private val isHeld   = RegInit(false.B)
  private val step     = RegInit(0.U(log2Ceil(stored + 1).W))
  private val rotates  = isHeld && step =/= stored.U
  private val gives    = isHeld && step === stored.U && io.mayTakeNext
  private val instance = io.instances(face.instance.get)
  io.mayComeNext := (!isHeld || gives) && !io.objectFace.valid
  assert(!io.objectFace.valid || RegNext(io.mayComeNext, false.B), "a face comes when none may")
  when(gives) { isHeld := false.B }
  when(rotates) { step := step + 1.U }

  // Products of a normal and the matrix; then their sums of three, to nearest even
  private val fraction = ObjectInstance.normalFraction
  private val most     = NumberFormats.unitNormal
  private val normals  = face.normals.toSeq :+ face.geometricNormal
  private val inWorld  = instance.normal.map { row =>
    val terms = row.axes.zip(normals.head.axes).map { case (factor, each) =>
      val term = Reg(SInt((ObjectInstance.normalBits + NumberFormats.normalBits).W))
      term := factor * each.integer
      term
    }
    val raised = terms.reduce(_ +& _) +& (BigInt(1) << (fraction - 1)).S
    val whole  = Rounding.floor(raised, fraction)
    val isTie  = raised(fraction - 1, 0) === 0.U
    Rounding.saturate(Mux(isTie, whole & (-2).S, whole), -most, most)
  }
  when(rotates) {
    for ((to, from) <- normals.zip(normals.tail)) to      := from
    for ((to, from) <- normals.last.axes.zip(inWorld)) to := Fixed(to.format, from)
  }
  when(isHeld && step === 0.U) { face.material := face.material + instance.materialBase }

  when(io.objectFace.valid) {
    face   := io.objectFace.bits
    isHeld := true.B
    step   := 0.U
  }
  io.grantNext.valid := gives
  io.grantNext.bits  := face.context
  io.face.valid      := RegNext(gives, false.B)
  io.face.bits       := face
}
